"""AMBF's own flags, as the scripts of labs write them."""

from __future__ import annotations

import shlex

import pytest
from ligature.cli.ambf_simulator import options_of
from ligature.cli.options import RunOptions


def options(line: str) -> RunOptions:
    return options_of(["--launch_file", "launch.yaml", *shlex.split(line)])


def test_the_line_of_the_suturing_challenge() -> None:
    run = options("-l 0,1,3,4,13,14 -p 200 -t1 --override_max_comm_freq 100 --override_min_comm_freq 90")
    assert (run.scene, run.models, run.rate) == ("launch.yaml", (0, 1, 3, 4, 13, 14), 200)
    assert (run.min_hz, run.max_hz, run.notes) == (90, 100, ())


def test_every_flag_has_its_long_name_too() -> None:
    short = options("-l 2 -a x.yaml -p 500 -t 1 -s 2 -g 0 -d 1 -f 0 -e 0 -n 1 -i 0,1")
    long = options(
        "--load_multibodies 2 --load_multibody_files x.yaml --phx_frequency 500 --fixed_phx_timestep true "
        "--sim_speed_factor 2 --show_gui false --htx_frequency 1 --fixed_htx_timestep 0 --enableforces 0 "
        "--ndevs 1 --load_devices 0,1"
    )
    assert short == long


def test_input_devices_are_taken_with_their_proxies() -> None:
    assert options("-l 2 -i 0,3").devices == (0, 3)
    assert options("-l 2").devices == ()
    assert (
        options("-n 3").devices == (0, 1, 2) and options("-n 3 -i 1").devices == (1,) and options("-n 0").devices == ()
    )


def test_haptic_flags_are_left_to_teleoperation() -> None:
    run = options("-d 500 -e 0 -f 1")
    assert (run.haptic_rate, run.haptic_forces, run.haptic_fixed) == (500.0, False, True)
    assert not options("-f 0").haptic_fixed and not options("").haptic_fixed
    assert (
        options("-e 1").haptic_forces is True and options("").haptic_forces is None and options("").haptic_rate == 0.0
    )


def test_blanks_in_the_list_of_indices_are_allowed() -> None:
    assert options("-l '10, 11,6'").models == (10, 11, 6)


def test_without_l_or_a_the_second_entry_is_loaded_as_in_ambf() -> None:
    assert options("").models == (1,)


def test_with_a_alone_only_its_files_are_loaded() -> None:
    run = options("-a one.yaml,two.yaml")
    assert run.models == () and run.files == ("one.yaml", "two.yaml")


def test_a_prefix_and_a_speed_are_taken() -> None:
    run = options("--ns /lab -s 0.5")
    assert run.prefix == "/lab" and run.speed == 0.5


def test_flags_without_effect_are_accepted_and_reported() -> None:
    run = options("-t 0 -g 1 --plugins 'a.so, b.so'")
    assert run.notes == (
        "--plugins (AMBF's plug-ins in C++) has no effect here",
        "-t 0: the step is always fixed; simulated time falls behind on a machine that is too slow",
    )


def test_a_rate_of_no_whole_ticks_is_rounded_and_reported() -> None:
    assert options("-p 120").notes == (
        "-p 120: an update is a whole number of 1 ms ticks; using 8 ms, 125 updates per second",
    )


def test_a_rate_beyond_one_tick_is_capped_and_reported() -> None:
    run = options("-p 2000")
    assert run.rate == 1000 and run.notes == ("-p 2000: a tick lasts 1 ms; using 1000 updates per second",)


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("-l a", "-l 'a' is not a list of whole numbers such as 10,11,6"),
        ("-l 3,-1", "is not a list of whole numbers"),
        ("-p 0", "-p must be at least 1"),
        ("-p nan", "-p must be at least 1"),
        ("-s 0", "-s larger than 0"),
        ("-t maybe", "'maybe' is neither 1 nor 0"),
        ("--override_max_comm_freq 0", "--override_max_comm_freq must be at least 1 Hz, not 0"),
        ("--no_such_flag", "unrecognized arguments: --no_such_flag"),
    ],
)
def test_bad_flags_end_with_two_and_state_why(line: str, message: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        options(line)
    assert ended.value.code == 2 and message in capsys.readouterr().err


def test_a_missing_launch_file_flag_is_reported(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        options_of(["-l", "1"])
    assert "--launch_file" in capsys.readouterr().err


def test_options_travel_to_the_processes_unchanged() -> None:
    run = options("-l 1,2 -a x.yaml -p 120 --ns /lab --root /usr")
    assert RunOptions.from_text(run.to_text()) == run
