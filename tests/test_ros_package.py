"""The ROS 2 package around the pilot in C: compiled and run against a stand-in of the headers that it uses."""

import re
import shutil
import subprocess
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gbt_ocp.cli.main import main
from gbt_ocp.ocp.codegen.library import find_compiler

STAND_IN = Path(__file__).with_name("ros2_stand_in")
NODE = Path(__file__).resolve().parents[1] / "gbt_ocp" / "pilot" / "ros2"
MOST_LINES = 400

CXX = shutil.which("g++") or shutil.which("clang++")
needs_compilers = pytest.mark.skipif(find_compiler() is None or CXX is None, reason="no compiler of C and C++")


def generated(folder, *arguments):
    assert main(["codegen", *arguments, "--out", str(folder), "--ros2"]) == 0
    return folder


def built(package, scratch, prefix=""):
    """The program that drives the node, with the pilot of the package."""
    pilot, objects = package / "pilot", []
    for number, source in enumerate(sorted((pilot / "src").glob("*.c"))):
        objects.append(scratch / f"{number}.o")
        command = [*find_compiler(), "-std=c99", "-O1", "-ffp-contract=off", "-fno-math-errno", "-c", source]
        subprocess.run([*map(str, command), "-o", str(objects[-1])], check=True)
    driver = (STAND_IN / "drive.cpp").read_text()
    text = scratch / "drive.cpp"
    text.write_text(re.sub(r"\bgbt_(?!ocp\b)", f"{prefix}gbt_", driver).replace("GBT_", f"{prefix.upper()}GBT_"))
    program = scratch / "drive"
    flags = ["-std=c++17", "-O1", "-Wall", "-Wextra", "-Werror"]
    places = [STAND_IN / "include", package / "src", pilot / "src", pilot]
    command = [
        CXX,
        *flags,
        *(f"-I{place}" for place in places),
        str(text),
        *map(str, objects),
        "-o",
        str(program),
        "-lm",
    ]
    subprocess.run(command, check=True)
    # the node's own program too
    main_file = package / "src" / f"{prefix}gbt_pilot_node.cpp"
    command = [CXX, *flags, *(f"-I{place}" for place in places), str(main_file), *map(str, objects), "-o"]
    subprocess.run([*command, str(scratch / "node"), "-lm"], check=True)
    assert subprocess.run([scratch / "node"], check=False).returncode == 0
    return program


def tell(program, *lines):
    """What the node publishes, and what its pilot takes in, for these lines of input."""
    text = "\n".join(" ".join(map(str, line)) for line in lines) + "\n"
    return subprocess.run([program], input=text, capture_output=True, text=True, check=True).stdout.splitlines()


def numbers(line):
    return np.array([float(word) for word in line.split()[1:]])


@pytest.fixture(scope="module")
def plane(tmp_path_factory):
    folder = tmp_path_factory.mktemp("ros2")
    changes = ("tracker.kind=ekf", "sensor.noise_deg=0.3", "duration_s=6")
    package = generated(folder / "pilot", "case2", *(word for change in changes for word in ("--set", change)))
    return package, built(package, folder)


@pytest.fixture(scope="module")
def space(tmp_path_factory):
    folder = tmp_path_factory.mktemp("ros2")
    changes = ("tracker.kind=ekf", "sensor.noise_deg=0.3", "duration_s=4")
    arguments = ["case5", "--prefix", "bow_", *(word for change in changes for word in ("--set", change))]
    package = generated(folder / "pilot", *arguments)
    return package, built(package, folder, "bow_")


def replayed(program):
    done = subprocess.run([program, "loop"], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    found = re.fullmatch(
        r"(\d+) commands, (\d+) compared, 0 faults, off (\S+) from Python and (\S+) from C, (\d+) tracks, "
        r"(\d+) setpoints, (\d+) of (\d+) reports without a note, (\d+) warnings",
        done.stdout.splitlines()[-1],
    )
    assert found, done.stdout
    return [float(word) for word in found.groups()]


@needs_compilers
@pytest.mark.parametrize(
    "dimension", [pytest.param("plane", marks=pytest.mark.long), pytest.param("space", marks=pytest.mark.slow)]
)
def test_the_node_gives_the_commands_of_the_pilot_in_a_closed_loop(dimension, request):
    _, program = request.getfixturevalue(dimension)
    commands, compared, python, c, tracks, setpoints, _, reports, warnings = replayed(program)
    assert commands == (61 if dimension == "plane" else 41)
    assert compared > 0.8 * commands
    assert max(python, c) < 1e-3
    assert tracks >= commands - 2
    assert setpoints > 0.5 * commands
    assert reports >= 3
    assert warnings == 0


@pytest.mark.long
@needs_compilers
def test_attitudes_and_velocities_are_those_of_rep_103(space):
    """A vehicle that rolls and pitches: its velocity over ground and the direction of a bearing, against SciPy."""
    _, program = space
    rng = np.random.default_rng(3)
    for _ in range(5):
        yaw, pitch, roll = rng.uniform(-3.0, 3.0), *rng.uniform(-0.4, 0.4, 2)
        turn = Rotation.from_euler("ZYX", [yaw, pitch, roll])
        position, velocity, spin, line = rng.normal(size=(4, 3)) * [[10.0], [1.0], [0.3], [20.0]]
        odometry = ("odometry", 0.0, "map", "base_link", *position, *turn.as_quat(), *velocity, *spin, 0.04)
        bearing = ("bearing", 0.0, "base_link", *turn.inv().apply(line))
        own, again, seen = tell(program, odometry, bearing)
        assert own.startswith("own")
        assert again == own
        time, pose, rates, deviation = np.split(numbers(own), [1, 5, 9])
        np.testing.assert_allclose(time, 0.0)
        np.testing.assert_allclose(pose, [*position, yaw], atol=1e-12)
        np.testing.assert_allclose(rates[:3], turn.apply(velocity), atol=1e-12)
        assert rates[3] == pytest.approx(turn.apply(spin)[2], abs=1e-12)
        assert deviation == pytest.approx(0.2)
        _, azimuth, elevation = numbers(seen)
        assert np.exp(1j * azimuth) == pytest.approx(complex(*line[:2]) / np.hypot(*line[:2]), abs=1e-12)
        assert elevation == pytest.approx(np.arctan2(line[2], np.hypot(line[0], line[1])), abs=1e-12)


@pytest.mark.long
@needs_compilers
def test_what_is_in_a_wrong_frame_or_no_attitude_is_refused_and_reported(space):
    _, program = space
    still = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    right = ("odometry", 0.0, "map", "base_link", 1.0, 2.0, 0.0, 0.0, 0.0, 0.0, 1.0, *still, 0.0)
    wrong = [
        ("odometry", 0.0, "odom", "base_link", *right[4:]),
        ("odometry", 0.0, "map", "imu", *right[4:]),
        ("odometry", 0.0, "map", "base_link", 1.0, 2.0, 0.0, 0.0, 0.0, 0.0, 0.0, *still, 0.0),
        ("bearing", 0.0, "sonar", 1.0, 0.0, 0.0),
        ("bearing", 0.0, "map", 0.0, 0.0, 1.0),
        ("bearing", 0.0, "map", "nan", 0.0, 0.0),
    ]
    said = tell(program, *wrong, ("until", 0.16))
    assert not any(line.startswith(("own", "seen")) for line in said)
    assert [line for line in said if line.startswith("command")] == 2 * ["command base_link 0 0 0 0"]
    health = [line for line in said if line.startswith("health")][-1]
    assert health.startswith("health 2 no navigation")
    assert f"messages_refused={len(wrong)}" in health
    said = tell(program, right, ("bearing", 0.0, "map", 3.0, 3.0, 9.0), ("until", 0.16))
    seen = next(line for line in said if line.startswith("seen"))
    np.testing.assert_allclose(numbers(seen), [0.0, np.pi / 4, np.arctan2(9.0, np.hypot(3.0, 3.0))])
    assert [line for line in said if line.startswith("health")][-1].startswith("health 0 ok")


@pytest.mark.long
@needs_compilers
def test_a_covariance_that_says_unknown_is_none_and_yaw_goes_on_through_a_turn(space):
    _, program = space
    still = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    yaws, lines = (3.0, -3.1, -2.9, 3.1), []
    for step, yaw in enumerate(yaws):
        turn = Rotation.from_euler("Z", yaw).as_quat()
        lines.append(("odometry", 0.1 * step, "map", "base_link", 1.0, 2.0, -7.0, *turn, *still, -1.0))
    found = np.array([numbers(line) for line in tell(program, *lines)])
    np.testing.assert_allclose(found[:, 2:4], np.column_stack([[2.0] * 4, [-7.0] * 4]))
    np.testing.assert_allclose(found[:, 4], np.unwrap(yaws), atol=1e-12)
    np.testing.assert_array_equal(found[:, -1], 0.0)


@pytest.mark.slow
@needs_compilers
@pytest.mark.skipif(shutil.which("cmake") is None, reason="no cmake")
def test_the_package_builds_by_its_own_cmake_lists(space, tmp_path):
    package, _ = space
    found = [f"-D{name}_DIR={STAND_IN / 'cmake'}" for name in DEPENDENCIES]
    flags = "-DCMAKE_CXX_FLAGS=-Werror"
    configure = ["cmake", "-S", package, "-B", tmp_path / "build", *found, flags, f"-DCMAKE_INSTALL_PREFIX={tmp_path}"]
    subprocess.run(configure, check=True, capture_output=True)
    subprocess.run(["cmake", "--build", tmp_path / "build"], check=True, capture_output=True)
    subprocess.run(["cmake", "--install", tmp_path / "build"], check=True, capture_output=True)
    assert subprocess.run([tmp_path / "lib" / "bow_gbt_pilot" / "bow_gbt_pilot_node"], check=False).returncode == 0
    assert (tmp_path / "share" / "bow_gbt_pilot" / "config" / "bow_gbt_pilot.yaml").is_file()


DEPENDENCIES = ("ament_cmake", "diagnostic_msgs", "geometry_msgs", "nav_msgs", "rclcpp")


@pytest.mark.long
@needs_compilers
def test_names_of_the_package_take_the_prefix(space):
    package, _ = space
    manifest = ElementTree.parse(package / "package.xml").getroot()
    assert manifest.findtext("name") == "bow_gbt_pilot"
    assert {one.text for one in manifest.findall("depend")} | {"ament_cmake"} == set(DEPENDENCIES)
    assert re.fullmatch(r"\d+\.\d+\.\d+", manifest.findtext("version"))
    assert (package / "config" / "bow_gbt_pilot.yaml").is_file()
    for path in package.rglob("*"):
        if path.is_file() and path.name not in ("manifest.json", "vectors.h", "pilot_vectors.h"):
            text = path.read_text()
            assert not re.search(r"(?<!bow_)\bgbt_(?!ocp)", text), path
            assert "@" not in re.sub(r"\S+@localhost|@brief", "", text) or path.parent.name == "pilot", path


def test_the_node_is_small_and_needs_nothing_but_rclcpp_and_messages():
    texts = {path.name: path.read_text() for path in NODE.iterdir() if path.suffix in (".hpp", ".cpp")}
    assert sum(len(text.splitlines()) for text in texts.values()) <= MOST_LINES
    foreign = {found for text in texts.values() for found in re.findall(r'#include "(\w+)/', text)}
    assert foreign == set(DEPENDENCIES) - {"ament_cmake"}
    declared = set(re.findall(r'declare_parameter<[^>]+>\("(\w+)"', texts["gbt_pilot_node.hpp"]))
    declared |= {f"{name}_topic" for name in ("odometry", "bearing", "command", "setpoint", "track")}
    written = (NODE / "parameters.yaml").read_text()
    assert set(re.findall(r"^    (\w+):", written, re.MULTILINE)) == declared


def test_every_header_of_the_stand_in_is_one_that_the_node_needs():
    used = {found for path in NODE.glob("*.hpp") for found in re.findall(r'#include "(\w+/\S+)"', path.read_text())}
    have = {path.relative_to(STAND_IN / "include").as_posix() for path in (STAND_IN / "include").rglob("*.hpp")}
    beneath = {"builtin_interfaces/msg/time.hpp", "std_msgs/msg/header.hpp", "geometry_msgs/msg/vector3.hpp"}
    assert used <= have
    assert have <= used | beneath


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--solver", "ipopt"], "--ros2: found --solver ipopt; allowed: --solver compiled"),
        (["--set", "guidance={kind: static}"], "--pilot: guidance.kind: found static"),
        (["--prefix", "Bow"], "--prefix: found 'Bow'"),
    ],
)
def test_what_cannot_be_a_package_is_refused_in_one_line(tmp_path, capsys, arguments, says):
    assert main(["codegen", "case2", "--out", str(tmp_path / "out"), "--ros2", *arguments]) == 2
    assert says in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
