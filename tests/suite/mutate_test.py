"""scripts/mutate.py: faults stand in code alone, obvious ones are noticed, a hang and what does not compile are told apart, a
table is gone on with, and the tree is left as it was."""
import csv
import pathlib
import subprocess
import sys
import tempfile

SCRIPTS = pathlib.Path(__file__).resolve().parents[2] / "scripts"
sys.path.insert(0, str(SCRIPTS))
import faults  # noqa: E402


def check(what, holds, seen=""):
    if not holds:
        sys.exit(f"{what}: {seen}")


def places():
    text = '''// a + b is 1
#include <vector>
namespace n {
int declared(int a = 2);
double f(double a, double b) {
  const char* s = "a + b == 1";  /* 7 */
  if (a < b && b != 0.5) {
    throw InputError(a, b + 3);
  }
  std::vector<int> list(4);
  a += g(a, b);
  fmt::print("{}", a * b);
  h(a);  // a + b is 1;
  return a * b - 2;
}
}
'''
    found = faults.faults_in("x.cpp", text)
    changes = {(f.line, f.kind, text[f.begin:f.end], f.replacement) for f in found}
    expected = {(7, "operator", "<", "<="), (7, "operator", "&&", "||"), (7, "operator", "!=", "=="),
                (7, "constant", "0.5", "0.5 * 2"), (7, "negated condition", "a < b && b != 0.5", "!(a < b && b != 0.5)"),
                (10, "constant", "4", "5"), (11, "operator", "+=", "-="), (11, "dropped statement", "a += g(a, b);", ";"),
                (11, "swapped arguments", "a, b", "b, a"), (13, "dropped statement", "h(a);", ";"),
                (14, "operator", "*", "/"), (14, "operator", "-", "+"), (14, "constant", "2", "3")}
    check("places and changes", changes == expected, changes ^ expected)
    one = next(f for f in found if f.replacement == "==")
    check("a fault changes its place alone", one.applied(text) == text.replace("b != 0.5", "b == 0.5"))
    sources = {"x.cpp": text, "y.cpp": text}
    check("a seed fixes the order", faults.chosen(sources, 3) == faults.chosen(sources, 3))
    check("another seed is another order", faults.chosen(sources, 3) != faults.chosen(sources, 4))
    longer = {"x.cpp": text.replace("h(a);", "h(a);\n  k(a, b);"), "y.cpp": text}
    added = set(faults.chosen(longer, 3)) - set(faults.chosen(sources, 3))
    as_before = [f.change for f in faults.chosen(sources, 3) if f.kind == "operator"]
    check("a change elsewhere leaves the draw as it was",
          added and [f.change for f in faults.chosen(longer, 3) if f.kind == "operator"] == as_before, as_before)
    check("every fault is chosen once", len(set(faults.chosen(sources, 3))) == 2 * len(expected))
    check("kinds take turns", len({f.kind for f in faults.chosen(sources, 3)[:5]}) == 5)


SAMPLE = {
    "CMakeLists.txt": """cmake_minimum_required(VERSION 3.20)
project(sample LANGUAGES CXX)
enable_testing()
set(CMAKE_ARCHIVE_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}/lib)
add_library(sample STATIC lib/sum.cpp lib/unused.cpp lib/slow.cpp lib/hung.cpp)
foreach(name IN ITEMS sum_test other_test slow_test signal_test)
  add_executable(${name} ${name}.cpp)
  target_link_libraries(${name} PRIVATE sample)
  add_test(NAME ${name} COMMAND ${name})
endforeach()
""",
    # The loop never ends once its step is dropped; no test calls unused().
    "lib/sum.cpp": """int sum_to(int n) {
  int sum = 0, k = 1;
  while (k <= n) {
    sum += k;
    k += 1;
  }
  return sum;
}
""",
    "lib/slow.cpp": "int doubled(int slow) {\n  return slow * 2;\n}\n",
    "lib/hung.cpp": "int twice(int hung) {\n  return hung * 2;\n}\n",
    "slow_test.cpp": "#include <unistd.h>\nint doubled(int);\nint main() { usleep(400000); return doubled(4) == 8 ? 0 : 1; }\n",
    # Without a fault the program ends by the hangup that it sends itself, which its parent waits for.
    "signal_test.cpp": """#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>
int twice(int);
int main() {
  int status = 0;
  if (const pid_t child = fork()) return waitpid(child, &status, 0) == child && WIFSIGNALED(status) && twice(4) == 8 ? 0 : 1;
  raise(SIGHUP);
  return 0;
}
""",
    "lib/unused.cpp": "int unused(int a) {\n  return a + 1;\n}\n",
    "sum_test.cpp": "int sum_to(int);\nint main() { return sum_to(4) == 10 && sum_to(0) == 0 ? 0 : 1; }\n",
    "other_test.cpp": "int main() { return 0; }\n",
}


def a_sample():
    with tempfile.TemporaryDirectory() as folder:
        source = pathlib.Path(folder)
        for name, text in SAMPLE.items():
            (source / name).parent.mkdir(exist_ok=True)
            (source / name).write_text(text)
        (source / ".gitignore").write_text("build/\ndocs/\n")
        for command in (["init", "-q"], ["add", "."], ["-c", "user.name=t", "-c", "user.email=t@t", "commit", "-qm", "sample"]):
            subprocess.run(["git", "-C", folder, *command], check=True)

        def mutate(*arguments):
            return subprocess.run(["nohup", sys.executable, "-B", SCRIPTS / "mutate.py", "--source", folder, "--jobs", "2",
                                   "--limit", "2", "--files", "lib", *arguments], capture_output=True, text=True)

        def rows():
            with open(source / "docs/results/mutation.csv", newline="") as lines:
                return list(csv.DictReader(lines))

        first = mutate("--count", "3")
        check("three faults are counted", sum(r["outcome"] != "not built" for r in rows()) == 3, first.stdout + first.stderr)
        kept = rows()
        # A fault left by a kill in the middle, as if the machine had been switched off.
        left = source / "build/mutate/tree/lib/sum.cpp"
        check("the copy is as the tree when it ends", left.read_text() == SAMPLE["lib/sum.cpp"])
        left.write_text("int sum_to(int) { return 7; }\n")
        done = mutate("--count", "1000", "--resume", "--quick", "0.2")
        check("a table is gone on with", rows()[:len(kept)] == kept, done.stdout + done.stderr)
        check("no fault is tried twice", len({(r["file"], r["kind"], r["change"]) for r in rows()}) == len(rows()))
        outcome = {r["change"]: (r["outcome"], r["noticed_by"]) for r in rows()}
        check("a dropped sum is noticed", outcome["sum += k; -> nothing"] == ("killed", "sum_test"), outcome)
        check("a loop without end is noticed", outcome["k += 1; -> nothing"] == ("hung", "sum_test"), outcome)
        check("k <= n to k < n is noticed", outcome["while (k [<= -> <] n) {"] == ("killed", "sum_test"), outcome)
        check("a slow test sees what the quick ones let pass", outcome["return slow [* -> /] 2;"] == ("killed", "slow_test"), outcome)
        check("a test hears the hangup that this program ignores", outcome["return hung [* -> /] 2;"] == ("killed", "signal_test"), outcome)
        check("what no test reaches survives", outcome["return a [+ -> -] 1;"] == ("survived", ""), outcome)
        check("survivors bring the score below the aim", done.returncode == 1, done.returncode)
        # Explained as equivalent, they do not count; a reason holds wherever the line has gone.
        survivors = [r for r in rows() if r["outcome"] == "survived"]
        with open(source / "docs/results/mutation_reasons.csv", "w", newline="") as out:
            writer = csv.writer(out)
            writer.writerow(["file", "kind", "change", "equivalent", "reason"])
            for r in survivors:
                writer.writerow([r["file"], r["kind"], r["change"], "yes", "nobody calls it"])
        page = mutate("--page")
        check("explained survivors do not count", page.returncode == 0 and "100.0%" in page.stdout, page.stdout + page.stderr)
        text = (source / "docs/results/mutation.md").read_text()
        check("the page names place and reason", "lib/unused.cpp:2" in text and "nobody calls it" in text, text)
        status = subprocess.run(["git", "-C", folder, "status", "--porcelain"], capture_output=True, text=True).stdout
        check("the tree is left as it was", status == "", status)


places()
a_sample()
