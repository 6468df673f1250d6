"""The command and the module as processes: exit status, Ctrl-C, threads, imports."""

import os
import signal
import subprocess
import sys
import threading
import time

import pytest

import genu

COMMAND = os.path.join(os.path.dirname(sys.executable), "build-model")


def ran(*words):
    return subprocess.run([COMMAND, *map(str, words)], capture_output=True, text=True)


def test_exit_statuses(tmp_path):
    assert genu.__version__ in ran("--version").stdout
    assert ran(tmp_path / "none").returncode == 1
    assert ran("simulate").returncode == 2
    assert ran("--help").returncode == 0
    assert subprocess.run([sys.executable, "-m", "genu", "--version"], capture_output=True).returncode == 0


def test_ctrl_c_ends_the_command_at_once(specimen, tmp_path):
    process = subprocess.Popen([COMMAND, specimen, "--out", str(tmp_path / "build"), "--quiet"])
    time.sleep(1.0)
    process.send_signal(signal.SIGINT)
    assert process.wait(timeout=10) == 130


STOPPED = """
import sys, time, genu
try:
    genu.{call}
except KeyboardInterrupt:
    print("stopped")
    sys.exit(7)
"""


def interrupted(call, after):
    process = subprocess.Popen([sys.executable, "-c", STOPPED.format(call=call)], stdout=subprocess.PIPE, text=True)
    time.sleep(after)
    process.send_signal(signal.SIGINT)
    out, _ = process.communicate(timeout=60)
    return process.returncode, out


def test_ctrl_c_stops_a_build_and_the_next_one_goes_on(specimen, build, tmp_path):
    place = str(tmp_path / "build")
    code, out = interrupted(f"build({specimen!r}, out={place!r}, to='assemble')", 2.0)
    assert (code, out.strip()) == (7, "stopped")
    again = genu.build(specimen, out=place, to="assemble")
    assert [r["digest"] for r in again.log] == [r["digest"] for r in build.log]


def test_ctrl_c_stops_a_simulation(model, trials, tmp_path):
    place = model.save(tmp_path)
    # Thousands of trials: a quiet machine needs a minute for them, so the signal comes in the midst.
    many = pytest.importorskip("pandas").concat([trials] * 400, ignore_index=True)
    many["trial"] = [f"{name}_{number}" for number, name in enumerate(many["trial"])]
    many.to_csv(tmp_path / "trials.csv", index=False)
    begun = time.monotonic()
    code, out = interrupted(f"simulate({place!r}, {str(tmp_path / 'trials.csv')!r}, solver='explicit')", 2.0)
    assert (code, out.strip()) == (7, "stopped")
    assert time.monotonic() - begun < 30


def test_an_exception_of_the_callback_stops_the_work(specimen, tmp_path):
    def watcher(stage, share, message):
        raise ZeroDivisionError(stage)

    with pytest.raises(ZeroDivisionError):
        genu.build(specimen, out=tmp_path / "build", progress=watcher)
    assert genu.build(specimen, out=tmp_path / "build", to="ingest").stages == ["ingest"]


def test_other_threads_of_python_run_meanwhile(specimen, tmp_path):
    count, done = [0], threading.Event()

    def tick():
        while not done.is_set():
            count[0] += 1
            time.sleep(0.01)

    thread = threading.Thread(target=tick)
    thread.start()
    genu.build(specimen, out=tmp_path / "build", to="register")
    done.set()
    thread.join()
    assert count[0] > 20


def test_import_needs_nothing_but_the_standard_library():
    code = "import sys, genu; assert 'numpy' not in sys.modules, 'numpy'; genu.Build; assert 'pandas' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True)


def test_every_public_name_is_told_of():
    for name in genu.__all__:
        if name != "__version__":
            assert getattr(genu, name).__doc__, name
    assert "Functions" in genu.__doc__ and set(genu.__all__) <= set(dir(genu))
