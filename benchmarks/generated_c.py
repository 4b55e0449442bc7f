"""What the generated C costs: size, stack, memory, compile time, and the worst time over recorded closed loops.

    OPENBLAS_NUM_THREADS=1 python benchmarks/generated_c.py --seeds 3

For cases 2 and 5 with hard limits and with the penalty: the folder of ``gbt-ocp codegen``, its sources compiled one by
one with ``-std=c99 -Wall -Wextra -Wpedantic -Werror`` and the flags of its Makefile. Text and data are what ``size``
says of the objects. The stack is the sum of the frames of all functions as the compiler states them
(``-fstack-usage``, gcc), more than any chain of calls can need since nothing recurses. Times are those of every solve
of closed loops of 30 s through Python's binding (gcc -O3), processor time of the thread.
"""

from __future__ import annotations

import argparse
import io
import json
import resource
import shutil
import subprocess
import tempfile
from contextlib import redirect_stdout
from pathlib import Path

import numpy as np
from solver import measure, times_of, warmed
from solver_instances import closed_loop_instances

from gbt_ocp.cli import main as cli
from gbt_ocp.ocp.solvers.compiled import CompiledSolver

FLAGS = ("-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-fno-math-errno", "-ffp-contract=off")


def children() -> float:
    """Processor time of the finished child processes, s."""
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def compiled(folder: Path, compiler: str, level: str) -> tuple[int, int, int | None, float]:
    """Text and data in bytes, bound of the stack in bytes (gcc), processor seconds."""
    objects = folder / f"{compiler}{level}"
    objects.mkdir()
    stack = ["-fstack-usage"] if compiler == "gcc" else []
    began = children()
    for source in sorted((folder / "src").glob("*.c")):
        command = [compiler, *FLAGS, level, *stack, "-c", str(source.resolve()), "-o", f"{source.stem}.o"]
        subprocess.run(command, check=True, cwd=objects)
    seconds = children() - began
    listed = subprocess.run(["size", *map(str, objects.glob("*.o"))], check=True, capture_output=True, text=True)
    sizes = np.array([[int(cell) for cell in line.split()[:3]] for line in listed.stdout.splitlines()[1:]]).sum(axis=0)
    frames = [line.split("\t") for path in objects.glob("*.su") for line in path.read_text().splitlines()]
    if any(kind.startswith("dynamic") and "bounded" not in kind for *_, kind in frames):
        raise SystemExit("a stack frame without a bound")
    return int(sizes[0]), int(sizes[1] + sizes[2]), sum(int(size) for _, size, _ in frames) or None, seconds


def main() -> None:
    """Print the tables as Markdown."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--seconds", type=float, default=30.0)
    arguments = parser.parse_args()
    compilers = [name for name in ("gcc", "clang") if shutil.which(name)]
    cases = [(case, formulation) for case in ("case2", "case5") for formulation in ("hard", "penalty")]
    print("| | compiler | text, B | data, B | stack at most, B | memory of the planner, B | compiled in, s |")
    print("|---|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as place:
        for case, formulation in cases:
            folder = Path(place, f"{case}-{formulation}")
            settings = [f"planner.formulation={formulation}", "planner.solver=compiled"]
            with redirect_stdout(io.StringIO()):
                assert cli.main(["codegen", case, "--set", *settings, "--out", str(folder)]) == 0
            memory = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))["sizes"]["planner"]
            for compiler in compilers:
                for level in ("-Os", "-O2", "-O3"):
                    text, data, stack, seconds = compiled(folder, compiler, level)
                    cells = [
                        f"{text:,}",
                        f"{data:,}",
                        "" if stack is None else f"{stack:,}",
                        f"{memory:,}",
                        f"{seconds:.2f}",
                    ]
                    print(f"| {case}, {formulation} | {compiler} {level} | {' | '.join(cells)} |", flush=True)
    print("\n| | solves | solved | iterations, most | median ms | 99 % ms | worst ms |\n|---|---|---|---|---|---|---|")
    for case, formulation in cases:
        rows = []
        for seed in range(arguments.seeds):
            problem, asked = closed_loop_instances(case, formulation, 4, seed, arguments.seconds, 5)
            rows += measure(problem, warmed(CompiledSolver(problem, {}), asked[0]), asked)
        times = times_of(rows)
        print(
            f"| {case}, {formulation} | {len(rows)} | {sum(row.solved for row in rows)} "
            f"| {max(row.iterations for row in rows)} | {np.median(times):.3f} | {np.percentile(times, 99):.3f} "
            f"| {times.max():.3f} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
