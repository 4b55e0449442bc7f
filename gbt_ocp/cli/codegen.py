"""``gbt-ocp codegen``: the planner of an experiment as C, all of its pilot, or a ROS 2 package around that."""

from __future__ import annotations

import argparse

from gbt_ocp.cli.arguments import add_config, add_out, add_set
from gbt_ocp.cli.exit_codes import DONE, LIMIT_BROKEN
from gbt_ocp.cli.folders import refuse_unwritable
from gbt_ocp.cli.output import remark, show
from gbt_ocp.cli.subcommand import Subcommand
from gbt_ocp.experiments.config.faults import ConfigurationError
from gbt_ocp.experiments.config.guidance import PlannerGuidanceSection
from gbt_ocp.experiments.config.loading import load_config


def _add_arguments(parser: argparse.ArgumentParser) -> None:
    add_config(parser)
    add_out(parser, "a new or empty folder", required=True)
    add_set(parser)
    parser.add_argument("--solver", choices=("compiled", "ipopt"), default="compiled", help="what solves it in C")
    parser.add_argument(
        "--prefix", metavar="NAME_", default="", help="of all names in it, for programs with several planners"
    )
    parser.add_argument("--pilot", action="store_true", help="the tracker, the guidance and the follower with it")
    parser.add_argument("--ros2", action="store_true", help="a ROS 2 package around the pilot; --pilot is implied")
    parser.add_argument("--verify", action="store_true", help="build it, run its recorded steps, make it fail")


def _carry_out(arguments: argparse.Namespace) -> int:
    configuration = load_config(arguments.config, overrides=arguments.set)
    if configuration.vehicles:
        count = len(configuration.vehicles)
        raise ConfigurationError([f"vehicles: found {count}; allowed: none here, what is written is for one vehicle"])
    refuse_unwritable(arguments.out)

    from gbt_ocp.experiments.build.loop import build_problem, build_vehicle
    from gbt_ocp.experiments.build.pilot import build_pilot
    from gbt_ocp.experiments.pilot_in_c import pilot_sources, with_compiled_tracker
    from gbt_ocp.experiments.recorded_pilot import RecordedPilot
    from gbt_ocp.experiments.recorded_steps import recorded_steps
    from gbt_ocp.experiments.ros_package import PILOT_FOLDER, write_ros_package
    from gbt_ocp.ocp.codegen.library import CompilerError
    from gbt_ocp.ocp.codegen.problem_source import from_moments
    from gbt_ocp.ocp.export.folder import write_c
    from gbt_ocp.ocp.export.ipopt_source import write_ipopt_folder
    from gbt_ocp.ocp.export.names import checked_prefix
    from gbt_ocp.ocp.export.vectors import OFFERED
    from gbt_ocp.ocp.export.verification import verify_folder
    from gbt_ocp.ocp.problem_data import ProblemData
    from gbt_ocp.ocp.solvers.base import options_beside

    section, solver = configuration.planner, arguments.solver
    with_pilot = arguments.pilot or arguments.ros2
    if arguments.verify and solver != "compiled":
        raise ConfigurationError(["--verify: found --solver ipopt; allowed: --solver compiled"])
    if with_pilot and solver != "compiled":
        asked = "--ros2" if arguments.ros2 else "--pilot"
        raise ConfigurationError([f"{asked}: found --solver ipopt; allowed: --solver compiled"])
    try:
        prefix = checked_prefix(arguments.prefix)
    except ValueError as fault:
        raise ConfigurationError([f"--{fault}"]) from fault
    try:
        problem = build_problem(configuration, build_vehicle(configuration))
        options = options_beside(section.solver, solver, section.solver_options)
        beside = {}
        if with_pilot:
            beside = pilot_sources(configuration) | RecordedPilot(configuration).files
            configuration = with_compiled_tracker(configuration)
        if solver == "compiled":
            planner = problem.compile(solver, options)
            # of the closed loop; made up only where nothing is planned there, which the moments of a forecast allow
            planned = isinstance(configuration.guidance, PlannerGuidanceSection)
            steps = recorded_steps(configuration, planner, OFFERED) if planned or not from_moments(problem) else None
            if arguments.ros2:
                write_ros_package(
                    arguments.out,
                    build_pilot(configuration),
                    str(arguments.config),
                    prefix,
                    lambda folder: write_c(planner, folder, steps, prefix, beside),
                )
            else:
                write_c(planner, arguments.out, steps, prefix, beside)
        else:
            if not isinstance(problem, ProblemData):
                raise ConfigurationError(["planner.form: found shooting with --solver ipopt; allowed: flat"])
            write_ipopt_folder(problem, options, arguments.out, prefix)
    except ConfigurationError:
        raise
    except CompilerError as fault:
        raise ConfigurationError([f"codegen: {fault}"]) from fault
    except FileExistsError as fault:
        raise ConfigurationError([f"--out: {fault}"]) from fault
    except OSError as fault:
        raise ConfigurationError(
            [f"--out: found {arguments.out}, which cannot be written ({fault}); allowed: a writable folder"]
        ) from fault
    except ValueError as fault:
        raise ConfigurationError([f"{arguments.config}: planner: {fault}"]) from fault
    show(arguments.out)
    if not arguments.verify:
        return DONE
    found = verify_folder(arguments.out / PILOT_FOLDER if arguments.ros2 else arguments.out)
    for line in found.faults:
        remark(line)
    if found.replayed is not None:
        show(f"closed loop of the pilot: {found.replayed}")
    show(f"{found.vectors} recorded steps, largest difference {found.difference:.3g}, {len(found.faults)} faults")
    return LIMIT_BROKEN if found.faults else DONE


CODEGEN = Subcommand(
    "codegen",
    "write the planner of an experiment as C without dependencies",
    (
        "gbt-ocp codegen case2 --out planner_c --set planner.formulation=hard --verify",
        "gbt-ocp codegen case2 --out pilot_c --pilot --verify",
        "gbt-ocp codegen case2 --out ros2_ws/src/pilot --ros2",
    ),
    _add_arguments,
    _carry_out,
)
