"""The command line ``gbt-ocp``: reads the arguments, carries out the subcommand, and answers for what went wrong.

Results go to standard output, progress and faults to standard error. :mod:`gbt_ocp.cli.exit_codes` has the exit codes.
"""

from __future__ import annotations

import os
import traceback
from collections.abc import Sequence

# The matrices are small (20 to 60 rows): handing them to several threads costs many times what it saves. The BLAS
# libraries read these when numpy is imported, which the next imports do. What the user has set stays.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("MKL_NUM_THREADS", "1")

from gbt_ocp.cli.exit_codes import DONE, INTERRUPTED, PROGRAM_FAULT, WRONG_INPUT
from gbt_ocp.cli.output import OutputError, leave_standard_output, remark
from gbt_ocp.cli.parser import SUBCOMMANDS, parser
from gbt_ocp.experiments.config.faults import ConfigurationError


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line.

    Parameters
    ----------
    argv
        Arguments without the program's name; ``None`` for those of the process.

    Returns
    -------
    int
        Exit code.
    """
    try:
        arguments = parser().parse_args(argv)
    except SystemExit as leave:
        return leave.code if isinstance(leave.code, int) else DONE
    try:
        return SUBCOMMANDS[arguments.subcommand].carry_out(arguments)
    except ConfigurationError as error:
        remark("\n".join(error.faults))
        return WRONG_INPUT
    except OutputError as error:
        remark(str(error))
        return WRONG_INPUT
    except BrokenPipeError:
        leave_standard_output()  # the reader (`gbt-ocp schema | head`) has seen enough
        return DONE
    except KeyboardInterrupt:
        remark("interrupted: nothing was written")
        return INTERRUPTED
    except OSError as fault:
        # of a renaming the second name is what was to be written
        where = fault.filename2 or fault.filename
        if where is None:
            remark(traceback.format_exc().rstrip())
            return PROGRAM_FAULT
        remark(f"{where}: found what cannot be read or written ({fault.strerror}); allowed: a file that can")
        return WRONG_INPUT
    except Exception:
        remark(traceback.format_exc().rstrip())
        return PROGRAM_FAULT
