"""`python -m incpt` is the command `incpt`."""

import sys

from incpt.cli.main import main

sys.exit(main())
