"""See `reference`."""

import sys

from reference.pages import main

sys.exit(main(sys.argv[1:]))
