"""One thread for linear algebra: the matrices are small, and the tests run side by side."""

import os

for _library in ("OPENBLAS", "OMP", "MKL"):  # read when numpy is imported, which is after this
    os.environ.setdefault(f"{_library}_NUM_THREADS", "1")
