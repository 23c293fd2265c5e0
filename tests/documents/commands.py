"""The commands that documents show. Blocks of docs/tutorial.md are run as they stand; every `phyxel` and `mpirun`
command of the README, the other pages and the program's own help is run, or, where that takes long, its options
are held against the program's.

    commands.py <phyxel> <source folder> <work folder> [mpirun]
"""
import json
import math
import os
import pathlib
import re
import shutil
import subprocess
import sys
import time

PROGRAM, SOURCE, WORK = (pathlib.Path(p).resolve() for p in sys.argv[1:4])
STUDIES = PROGRAM.with_name("phyxel_studies")  # the developers' program, beside the users'
MPIRUN = len(sys.argv) > 4
FFMPEG = shutil.which("ffmpeg") is not None
failures = []

# What takes minutes, wants a GPU, or needs what only a finished measurement leaves.
LONG = re.compile(r"\bphyxel (paper|bench|accuracy|view)\b|phyxel_studies|cluster|twist|large_body|-n [3-9]|cuda|big|ten_dinos|--until 0\.5|"
                  r"--render|horn_bug|alien_head|2000000|scan.ply|gear.stl")


def sphere_obj(across=24):
    """A closed surface of radius 1, as OBJ."""
    lines = ["v 0 0 1", "v 0 0 -1"]
    rings, around = across // 2 - 1, across
    for r in range(rings):
        polar = math.pi * (r + 1) / (rings + 1)
        for k in range(around):
            turn = 2 * math.pi * k / around
            lines.append(f"v {math.sin(polar) * math.cos(turn)} {math.sin(polar) * math.sin(turn)} {math.cos(polar)}")
    at = lambda r, k: 3 + r * around + k % around
    for k in range(around):
        lines += [f"f 1 {at(0, k)} {at(0, k + 1)}", f"f 2 {at(rings - 1, k + 1)} {at(rings - 1, k)}"]
        for r in range(rings - 1):
            lines += [f"f {at(r, k)} {at(r + 1, k)} {at(r + 1, k + 1)}", f"f {at(r, k)} {at(r + 1, k + 1)} {at(r, k + 1)}"]
    return "\n".join(lines) + "\n"


def environment():
    home = WORK / "home"
    (home / ".config/fish/completions").mkdir(parents=True, exist_ok=True)
    return {**os.environ, "HOME": str(home), "PATH": f"{PROGRAM.parent}:{os.environ['PATH']}", "OMPI_ALLOW_RUN_AS_ROOT": "1",
            "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1", "OMPI_MCA_rmaps_base_oversubscribe": "1", "OMP_WAIT_POLICY": "passive"}


def shell(text, folder):
    return subprocess.run(["bash", "-euo", "pipefail", "-c", text], cwd=folder, env=environment(),
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)


def fail(where, command, output):
    failures.append(where)
    print(f"FAILED {where}: {command}\n{output}")


def fresh(folder):
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    (folder / "examples").symlink_to(SOURCE / "examples")
    shutil.copytree(SOURCE / "docs", folder / "docs")  # some commands write there
    return folder


# --- the tutorial --------------------------------------------------------------------------------

def tutorial():
    folder = fresh(WORK / "tutorial")
    text = (SOURCE / "docs/tutorial.md").read_text()
    blocks = re.findall(r"^```sh\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    assert len(blocks) >= 8
    for number, block in enumerate(blocks, 1):
        if "mpirun" in block and not MPIRUN:
            continue
        start = time.monotonic()
        done = shell(block, folder)
        print(f"{time.monotonic() - start:6.1f} s  docs/tutorial.md, block {number}", flush=True)
        if done.returncode != 0:
            fail(f"docs/tutorial.md, block {number}", block, done.stdout)
            return
    for left in ("out/ring/report.html", "out/ring/pictures/frame_000025.png", "ring.vtkhdf", "out/rest_3000/energy.csv"):
        assert (folder / left).exists(), left


# --- single commands -----------------------------------------------------------------------------

def commands_of(text):
    """Lines that begin a command of ours, in code only; without the remark that follows it."""
    code = re.findall(r"^```(?:sh)?\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    code.append("\n".join(re.findall(r"^    (.*)$", text, re.MULTILINE)))
    named = re.findall(r"`((?:mpirun|phyxel|phyxel_studies) [^`]*)`", text)  # in a sentence: not the whole of it
    for is_whole, lines in ((True, "\n".join(code).splitlines()), (False, named)):
        for line in lines:
            line = re.split(r"\s{2,}|\s#", line.strip())[0]
            if re.match(r"(mpirun .*)?phyxel(_studies)? [a-z]", line) and "<" not in line and "..." not in line and "|" not in line:
                yield line, is_whole


def options_are_known(command):
    program, words = re.search(r"\b(phyxel(?:_studies)?) (.*)", command).groups()
    program, words = STUDIES if program == "phyxel_studies" else PROGRAM, words.split()
    names = [w for w in words if not w.startswith("-")]
    helps = subprocess.run([program, words[0], "--help"], capture_output=True, text=True)
    if helps.returncode != 0:
        return f"{program.name} {words[0]}: no such command"
    text = helps.stdout
    if re.search(rf"^Usage: .* {words[0]} \[OPTIONS\] SUBCOMMAND", text, re.MULTILINE) and len(names) > 1 and \
            not re.search(rf"^  {names[1]} ", text, re.MULTILINE):
        return f"{program.name} {words[0]} {names[1]}: no such command"
    if len(names) > 1:  # bench step
        text += subprocess.run([program, *names[:2], "--help"], capture_output=True, text=True).stdout
    unknown = [w.split("=")[0] for w in words if w.startswith("--") and w != "--help" and w.split("=")[0] not in text]
    return f"unknown: {' '.join(unknown)}" if unknown else ""


def stage(readme):
    """A folder in which the commands find what they name."""
    folder = fresh(WORK / "commands")
    for name in ("bunny.obj", "ring.obj"):
        (folder / name).write_text(sphere_obj())
    scene = re.search(r"^```toml\n(.*?)^```", readme, re.MULTILINE | re.DOTALL).group(1)
    (folder / "scene.toml").write_text(scene)
    for preparation in ("phyxel sample bunny.obj --phyxels 5000 --out bunny.h5",
                        "phyxel run examples/dino/scene.toml --no-pictures"):
        done = shell(preparation, folder)
        if done.returncode != 0:
            fail("README.md", preparation, done.stdout)
    return folder


def run_alone(command, staged):
    """In a folder as it was before any other command."""
    folder = WORK / "one"
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(staged, folder, symlinks=True)
    for asked in re.findall(r"(?:--out|--single|-o|--csv) (\S+)", command):
        target = folder / asked
        if target.is_dir() and "run" in command.split():
            shutil.rmtree(target)
        elif target.is_file():
            target.unlink()
    if command.startswith("phyxel run examples/dino"):
        shutil.rmtree(folder / "out/dino", ignore_errors=True)
    return shell(command, folder)


def pages():
    readme = (SOURCE / "README.md").read_text()
    documents = {"README.md": readme}
    for page in [SOURCE / "CONTRIBUTING.md", *sorted((SOURCE / "docs").glob("*.md")), SOURCE / "docs/results/README.md"]:
        if page.name != "tutorial.md":
            documents[str(page.relative_to(SOURCE))] = page.read_text()
    for program in (PROGRAM, STUDIES):
        overview = subprocess.run([program, "--help"], capture_output=True, text=True).stdout
        for name in re.findall(r"^  ([a-z][a-z-]+) ", overview.split("Subcommands:")[1].split("\n\n")[0], re.MULTILINE):
            text = subprocess.run([program, name, "--help"], capture_output=True, text=True).stdout
            examples = re.search(r"^Examples?:\n((?:  .*\n?|\n)*)", text, re.MULTILINE)
            if not examples:
                fail(f"{program.name} {name} --help", "", "has no example")
                continue
            documents[f"{program.name} {name} --help"] = re.sub(r"^  ", "    ", examples.group(1), flags=re.MULTILINE)
    seen, ran = set(), 0
    staged = stage(readme)
    for where, text in documents.items():
        for command, is_whole in commands_of(text):
            if command in seen:
                continue
            seen.add(command)
            wrong = options_are_known(command)
            if wrong:
                fail(where, command, wrong)
            elif "--video" in command and not FFMPEG:
                print(f"SKIPPED, as there is no ffmpeg: {command}", flush=True)
            elif is_whole and not LONG.search(command) and (MPIRUN or not command.startswith("mpirun")):
                start = time.monotonic()
                done = run_alone(command, staged)
                ran += 1
                print(f"{time.monotonic() - start:6.1f} s  {command}", flush=True)
                if done.returncode != 0:
                    fail(where, command, done.stdout)
    print(f"{len(seen)} commands, {ran} of them run")
    assert len(seen) > 40 and ran > 15, "the search for commands finds too few"


def scripts_and_presets():
    """What else a shell is asked for: scripts that are there, presets that exist, links that lead somewhere."""
    presets = json.loads((SOURCE / "CMakePresets.json").read_text())
    names = {p["name"] for kind in ("configurePresets", "buildPresets", "testPresets", "workflowPresets") for p in presets.get(kind, [])}
    for page in [SOURCE / "README.md", SOURCE / "CONTRIBUTING.md", *(SOURCE / "docs").glob("*.md"), *(SOURCE / "examples").glob("*/*.md")]:
        text = page.read_text()
        for script in re.findall(r"(?<![\w/])((?:scripts|bench)/[\w./-]+\.(?:sh|py))", text):
            if not (SOURCE / script).exists():
                fail(page.name, script, "is not there")
        for preset in re.findall(r"--preset (\w+)", text):
            if preset not in names:
                fail(page.name, preset, "no such preset")
        for link in re.findall(r"\]\(([^)#\s]+)(?:#[\w-]*)?\)", text):
            if not re.match(r"[a-z]+:", link) and not (page.parent / link).exists():
                fail(page.name, link, "leads nowhere")


def main():
    WORK.mkdir(parents=True, exist_ok=True)
    scripts_and_presets()
    tutorial()
    pages()
    shutil.rmtree(WORK, ignore_errors=True)
    sys.exit(1 if failures else 0)


if __name__ == "__main__":
    main()
