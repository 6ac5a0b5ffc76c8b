"""`python -m incpt` is the command `incpt`."""

import sys

from incpt.cli import main

sys.exit(main())
