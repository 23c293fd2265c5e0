"""Runs LAMMPS, for comparison with phyxel."""
import pathlib
import re
import subprocess

HERE = pathlib.Path(__file__).resolve().parent
RESULTS = HERE.parent.parent / "docs" / "results"


def output_of(lmp, script, ranks, **variables):
    """The output of LAMMPS for a script of this folder."""
    command = ["mpirun", "--allow-run-as-root", "--bind-to", "core", "-np", str(ranks), lmp, "-in", str(HERE / script),
               "-log", "none"]
    for name, value in variables.items():
        command += ["-var", name, str(value)]
    return subprocess.run(command, capture_output=True, text=True, check=True,
                          env={"OMP_NUM_THREADS": "1", "PATH": "/usr/bin:/bin", "HOME": "/tmp"}).stdout


def loop_time(output):
    """The time of the last run, without set-up [s]."""
    return float(re.findall(r"Loop time of (\S+)", output)[-1])


def processor():
    return re.search(r"model name\s*: (.*)", pathlib.Path("/proc/cpuinfo").read_text())[1]
