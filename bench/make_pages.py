#!/usr/bin/env python3
"""Generates pages from the tables in docs/results and draws their charts beside the tables. No number on these pages is
typed by hand.

    bench/make_pages.py                         all pages
    bench/make_pages.py accuracy                this page alone, of: performance, scaling, accuracy, laws,
                                                contact, cpu, readme, gallery
    bench/make_pages.py --check                 writes nothing; fails if a page is not up to date

performance, scaling, accuracy, laws and contact are docs/<name>.md; cpu is docs/results/README.md; readme is what README.md
has of the tables; gallery is docs/gallery.md, which is made from the first comments of examples/, with pictures by
scripts/draw_gallery.py. An error leaves all pages as they were. Drawing needs matplotlib 3.6 or later. --check needs Python
alone: it compares the text, since charts differ from one version of matplotlib to the next.

The tables come from scripts/measure_gpu.sh, measure_accuracy.py, measure_contact_examples.py and profile_gpu.sh,
bench/compare/*.py, and

    build/cpu/bin/phyxel bench step --csv docs/results/cpu_step.csv --force
    build/cpu/bin/phyxel bench step --terms green --threads 1,4,16 --phyxels 100000,1000000 \\
      --csv docs/results/cpu_step_16.csv --force
    for study in neighbours precision steps; do
      build/cpu/bin/phyxel_studies $study --csv docs/results/accuracy_$study.csv --force
    done
    build/cpu/bin/phyxel_studies pictures
    build/cpu/bin/phyxel_studies laws --csv docs/results/laws.csv --force
    build/cpu/bin/phyxel_studies neighbour-search --csv docs/results/cpu_neighbours.csv --force
    build/cpu/bin/phyxel accuracy hard --long --csv docs/results/hard_cases_cpu.csv --force
    for group in contact fracture; do
      taskset -c 0 build/cpu/bin/phyxel accuracy $group --csv docs/results/accuracy_$group.csv --force
    done
"""
import argparse
import difflib
import os
import pathlib
import sys
import tempfile

sys.dont_write_bytecode = True
from pages import accuracy, charts, contact, cpu, gallery, laws, performance, readme, scaling  # noqa: E402
from pages.tables import PageError, markdown_link  # noqa: E402

ROOT = pathlib.Path(__file__).resolve().parents[1]
PAGES = {"performance": performance, "scaling": scaling, "accuracy": accuracy, "laws": laws, "contact": contact, "cpu": cpu}
WRONG_INPUT = 2


def write_whole(file, content):
    """Writes a file by way of a temporary one: a reader sees the old content or the new one, never a part."""
    handle, name = tempfile.mkstemp(dir=file.parent, prefix=f".{file.name}.")
    try:
        with os.fdopen(handle, "wb") as out:
            out.write(content)
        os.chmod(name, 0o644)
        os.replace(name, file)
    except BaseException:
        os.unlink(name)
        raise


def made(names, results, out, readme_file):
    """Generates pages: their texts and their charts, each by its file."""
    texts, drawings = {}, {}
    for name in names:
        if name == "readme":
            try:
                texts[readme_file] = readme.with_blocks(readme_file, readme_file.read_text(encoding="utf-8"), results)
            except FileNotFoundError:
                raise PageError(f"{readme_file}: no such file; allowed: a README with a table of speeds") from None
            continue
        if name == "gallery":
            texts[out / "gallery.md"] = gallery.make(ROOT, out).text()
            continue
        file = results / "README.md" if name == "cpu" else out / f"{name}.md"
        link = markdown_link(os.path.relpath(results, file.parent))
        page = PAGES[name].make(results, "" if link == "." else link + "/")
        if page:
            texts[file] = page.text()
            drawings.update({results / f"{chart}.svg": drawn for chart, drawn in page.charts.items()})
    return texts, drawings


def differences(texts, drawings, others):
    """Describes pages and charts that are not up to date. `others` are the charts in the folder."""
    found = []
    for file, text in texts.items():
        old = file.read_text(encoding="utf-8", errors="replace") if file.exists() else ""
        if old != text:
            lines = difflib.unified_diff(old.splitlines(), text.splitlines(), str(file), "what the tables say", "", "", 0, "")
            found.append("\n".join(line[:2000] for line in list(lines)[:20]))
    found += [f"{file}: a page shows this chart, which is not there" for file in drawings if not file.exists()]
    found += [f"{file}: no page shows this chart" for file in sorted(others) if file not in drawings]
    return found


def run(options):
    results = options.results
    if not results.is_dir():
        raise PageError(f"{results}: no such folder; allowed: one with tables of measurements")
    out = options.out or results.resolve().parent
    own = results.resolve() == ROOT / "docs/results"
    readme_file = options.readme or (ROOT / "README.md" if own else None)
    if "readme" in options.pages and not readme_file:
        raise PageError(f"{results}: not the project's own tables; allowed: these, or --readme with the page readme")
    names = options.pages or [*PAGES, *(["readme"] if readme_file else []), *(["gallery"] if own else [])]
    texts, drawings = made(names, results, out, readme_file)
    if options.check:
        found = differences(texts, drawings, [] if options.pages else results.glob("*.svg"))
        for difference in found:
            print(difference)
        if found:
            print("Pages are not what the tables say: run bench/make_pages.py")
        return 1 if found else 0
    try:
        drawn = {file: charts.draw(chart) for file, chart in drawings.items()}
    except ImportError as error:
        raise PageError(f"charts cannot be drawn: {error} (Debian: python3-matplotlib)") from None
    for file, content in {**drawn, **{file: text.encode() for file, text in texts.items()}}.items():
        write_whole(file, content)
    return 0


def main(arguments=None):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("pages", nargs="*", metavar="page", help="all, if none is named")
    parser.add_argument("--results", type=pathlib.Path, default=ROOT / "docs/results", help="folder of the tables and charts")
    parser.add_argument("--out", type=pathlib.Path, help="folder of the pages; the one above the tables, if none is named")
    parser.add_argument("--readme", type=pathlib.Path, help="README.md, with the project's own tables; else none")
    parser.add_argument("--check", action="store_true", help="write nothing; exit code 1 if a page is not up to date")
    options = parser.parse_args(arguments)
    unknown = [name for name in options.pages if name not in (*PAGES, "readme", "gallery")]
    if unknown:
        parser.error(f"page {unknown[0]}: unknown; allowed: {', '.join(PAGES)}, readme, gallery")
    try:
        return run(options)
    except PageError as error:
        print(f"make_pages.py: {error}", file=sys.stderr)
    except OSError as error:
        print(f"make_pages.py: {error.filename}: {error.strerror}", file=sys.stderr)
    return WRONG_INPUT


if __name__ == "__main__":
    sys.exit(main())
