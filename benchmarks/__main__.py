"""`python -m benchmarks STUDY`: a study of the synthetic benchmark."""

import sys

from benchmarks.synthetic.command import main

if __name__ == "__main__":
    sys.exit(main())
