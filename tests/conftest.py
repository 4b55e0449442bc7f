"""What holds for all tests: one thread for linear algebra, and quick compilations."""

import os

for _library in ("OPENBLAS", "OMP", "MKL"):  # read when numpy is imported, which is after this
    os.environ.setdefault(f"{_library}_NUM_THREADS", "1")


def pytest_configure(config):
    """Compile solvers at -O0: a third of the time at -O3, and each problem of a test is compiled once.

    The arithmetic is that of the standard at all levels. Programs that a test starts compile as for a user.
    """
    from gbt_ocp.ocp.codegen import library

    library.FLAGS = tuple("-O0" if flag == "-O3" else flag for flag in library.FLAGS)
