"""No skip is silent, and no failure is one.

    skips_test.py <suite_sample> <build folder> <ctest>
"""
import json
import os
import pathlib
import re
import subprocess
import sys
import tempfile

SAMPLE, BUILD, CTEST = sys.argv[1:4]
SOURCE = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(SOURCE / "scripts"))
import skips  # noqa: E402

SKIPPED = 77  # tests/support/skips.hpp


def sample(cases, **environment):
    """Runs these cases of the sample: exit code, and what was counted."""
    with tempfile.TemporaryDirectory() as folder:
        file = pathlib.Path(folder) / "skips.txt"
        clean = {k: v for k, v in os.environ.items() if k not in ("CI", "PHYXEL_SKIPS") and not k.startswith("SAMPLE_")}
        done = subprocess.run([SAMPLE, "--gtest_filter=" + ":".join("Sample." + c for c in cases)], capture_output=True,
                              env={**clean, "PHYXEL_SKIPS": str(file), **environment})
        return done.returncode, file.read_text() if file.exists() else ""


def check(what, found, expected):
    if found != expected:
        sys.exit(f"{what}: {found!r}, not {expected!r}")


NO_GPU = "Sample.Skips\tno CUDA device\n"
check("a case that passes", sample(["Passes"]), (0, ""))
check("a case that skips", sample(["Skips"]), (SKIPPED, NO_GPU))
check("one of two that skips", sample(["Passes", "Skips"]), (0, NO_GPU))
check("a failure that speaks of skips", sample(["FailsThoughItSpeaksOfSkips"]), (1, ""))
check("a failure beside a skip", sample(["FailsThoughItSpeaksOfSkips", "Skips"]), (1, NO_GPU))
check("all cases skipped at once", sample(["Passes", "Skips"], SAMPLE_SKIPS_ALL="1"),
      (SKIPPED, "Sample.Passes\tno CUDA device\n" + NO_GPU))
MISSING = (SKIPPED, "Sample.NeedsATool\tmissing tool: fish\n")
for ci in ("", "0", "false"):
    check(f"a missing tool with CI={ci}", sample(["NeedsATool"], CI=ci), MISSING)
for ci in ("1", "true"):
    check(f"a missing tool with CI={ci}", sample(["NeedsATool"], CI=ci), (1, ""))
check("a tool that is there", sample(["NeedsATool"], CI="1", SAMPLE_HAS_TOOL="1"), (0, ""))

check("the summary of skips", skips.summary("A.a\tno GPU\nB.b\tno fish\nA.b\tno GPU\nA.c\tno GPU\nA.d\tno GPU\n"),
      ["    4  no GPU: A.a, A.b, A.c and 1 more", "    1  no fish: B.b"])

# What CTest is told of every test: a skip is an exit code, and no pattern that a failure's output could have.
tests = json.loads(subprocess.run([CTEST, "--test-dir", BUILD, "--show-only=json-v1"], capture_output=True, text=True,
                                  check=True).stdout)["tests"]
OUTPUTS = ["[  SKIPPED ] Sample.Skips (0 ms)", "no CUDA device", "[  FAILED  ] Sample.Skips", "missing tool: fish", ""]
programs = 0
for test in tests:
    properties = {p["name"]: p["value"] for p in test.get("properties", [])}
    patterns = properties.get("SKIP_REGULAR_EXPRESSION", [])
    for pattern in [patterns] if isinstance(patterns, str) else patterns:
        for output in OUTPUTS:
            if re.search(pattern, output):
                sys.exit(f"{test['name']}: output {output!r} would make a failure a skip, by {pattern!r}")
    if any("--gtest" in word for word in test.get("command", [])):
        programs += 1
        check(f"SKIP_RETURN_CODE of {test['name']}", properties.get("SKIP_RETURN_CODE"), SKIPPED)
if programs < 100:
    sys.exit(f"only {programs} tests run by GoogleTest were looked at")

# The program of 2008: its cases one by one, so that those without a GPU are seen as skipped, but for the sequential ones,
# which never skip and share an entry.
PROGRAM = BUILD + "/tests/paper_backend_test"


def cases(pattern):
    listed = subprocess.run([PROGRAM, "--gtest_list_tests", "--gtest_filter=" + pattern], capture_output=True, text=True,
                            check=True).stdout
    found, suite = [], ""
    for line in listed.splitlines():
        name = line.split("#")[0]
        if name.startswith("  "):
            found.append(suite + name.strip())
        else:
            suite = name.strip()
    return found


patterns = [word.split("=", 1)[1] for t in tests if t.get("command", [""])[0] == PROGRAM
            for word in t["command"] if word.startswith("--gtest_filter=")]
together = [p for p in patterns if "*" in p]
check("entries of paper_backend_test that hold several cases", len(together), 1)
alone = [p for p in patterns if "*" not in p]
for case in cases(together[0]):
    if "Gpu" in case or "Csr" in case:
        sys.exit(f"{case} may skip, which ctest would not show")
check("cases of paper_backend_test in CTest", sorted(alone + cases(together[0])), sorted(cases("*")))
