"""Command line of mocobot."""

import os

# The matrices are small: threads that fight over them make a diagnosis several times slower on a busy machine.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
