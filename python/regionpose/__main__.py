"""`python -m regionpose`: the command `regionpose`."""

import sys

from regionpose.cli import main

sys.exit(main())
