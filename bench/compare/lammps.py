"""Runs LAMMPS, for comparison with phyxel."""
import pathlib
import re
import subprocess

HERE = pathlib.Path(__file__).resolve().parent
RESULTS = HERE.parent.parent / "docs" / "results"
SHARES = (0.6, 0.5, 0.4, 0.3, 0.2, 0.1)  #: Steps tried, of the time of a pressure wave along a spacing.


def command(lmp, script, **variables):
    """The command that runs a script of this folder."""
    words = [lmp, "-in", str(HERE / script), "-log", "none"]
    for name, value in variables.items():
        words += ["-var", name, str(value)]
    return words


def output_of(lmp, script, ranks, **variables):
    """The output of LAMMPS for a script of this folder."""
    ranked = ["mpirun", "--allow-run-as-root", "--bind-to", "core", "-np", str(ranks), *command(lmp, script, **variables)]
    return subprocess.run(ranked, capture_output=True, text=True, check=True,
                          env={"OMP_NUM_THREADS": "1", "PATH": "/usr/bin:/bin", "HOME": "/tmp"}).stdout


def loop_time(output):
    """The time of the last run, without set-up [s]."""
    return float(re.findall(r"Loop time of (\S+)", output)[-1])


def processor():
    return re.search(r"model name\s*: (.*)", pathlib.Path("/proc/cpuinfo").read_text())[1]
