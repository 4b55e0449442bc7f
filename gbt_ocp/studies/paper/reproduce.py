"""``gbt-ocp reproduce``: studies by name, in a folder that can be resumed."""

from __future__ import annotations

import os
from pathlib import Path
from pkgutil import resolve_name

from gbt_ocp.experiments.config.faults import ConfigurationError
from gbt_ocp.experiments.sweep.carry_out import engine_for
from gbt_ocp.experiments.sweep.task_folder import at_work_in, free_name
from gbt_ocp.studies.paper import STUDIES
from gbt_ocp.studies.paper.workbench import Report, Workbench


class StudyInterruptedError(KeyboardInterrupt):
    """The study was interrupted; what was finished is in its folder.

    Attributes
    ----------
    folder
        Of the study.
    """

    def __init__(self, folder: Path, finished: str) -> None:
        self.folder = folder
        super().__init__(finished or f"the runs are kept in {folder}")


def reproduce(
    study: str,
    *,
    runs: int = 50,
    seed_from: int = 0,
    jobs: int | None = None,
    dask: str | None = None,
    out: str | os.PathLike[str] | None = None,
    resume: str | os.PathLike[str] | None = None,
    tune: bool = False,
    progress: bool = False,
) -> tuple[Path, dict[str, Report]]:
    """Conduct a study of the paper.

    Parameters
    ----------
    study
        A name of :data:`gbt_ocp.studies.paper.STUDIES`, or ``all``.
    runs, seed_from
        Seeds: ``seed_from``, ``seed_from + 1``, …
    jobs, dask
        See :func:`gbt_ocp.sweep`.
    out
        A new or empty folder; by default a new one in ``runs/``.
    resume
        Folder of a study with the same number of runs: sweeps that are finished there are not run again.
    tune
        Search for the parameters of the methods (tables) instead of taking those that are shipped.
    progress
        Show progress bars on standard error.

    Returns
    -------
    folder, reports
        The folder, and the reports by study; each lies in a folder of its name.

    Raises
    ------
    ConfigurationError
        If the input is wrong.
    StudyInterruptedError
        If Ctrl-C was pressed.
    """
    if study not in STUDIES and study != "all":
        raise ConfigurationError([f"study: found {study!r}; allowed: {', '.join([*STUDIES, 'all'])}"])
    if runs < 1 or seed_from < 0:
        raise ConfigurationError([f"found {runs} runs from seed {seed_from}; allowed: runs >= 1, seeds >= 0"])
    folder = _folder(study, out, resume)
    reports: dict[str, Report] = {}
    try:
        with at_work_in(folder, f"--resume {folder}"), engine_for(jobs, dask) as engine:
            if out is not None and any(folder.iterdir()):  # another process was faster
                raise _occupied(folder)
            seeds = tuple(range(seed_from, seed_from + runs))
            workbench = Workbench(folder, seeds, engine, tune, progress)
            for name in STUDIES if study == "all" else [study]:
                reports[name] = resolve_name(f"gbt_ocp.studies.paper.{STUDIES[name]}")(workbench)
                reports[name].write(folder / name)
    except KeyboardInterrupt as fault:
        raise StudyInterruptedError(folder, str(fault)) from fault
    return folder, reports


def _occupied(folder: Path) -> ConfigurationError:
    return ConfigurationError(
        [f"--out: found {folder}, which is not an empty folder; allowed: a new or empty folder (or --resume)"]
    )


def _folder(study: str, out: str | os.PathLike[str] | None, resume: str | os.PathLike[str] | None) -> Path:
    if resume is not None:
        folder = Path(resume)
        if not folder.is_dir():
            raise ConfigurationError([f"--resume: found {folder}, which is no folder; allowed: the folder of a study"])
        return folder
    folder = Path(out) if out is not None else free_name(Path("runs") / f"reproduce-{study}")
    if folder.exists() and not (folder.is_dir() and not any(folder.iterdir())):
        raise _occupied(folder)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as fault:
        raise ConfigurationError(
            [f"--out: found {folder}, which cannot be written ({fault}); allowed: a writable folder"]
        ) from fault
    return folder
