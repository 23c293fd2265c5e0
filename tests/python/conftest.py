"""Skips are counted, and in CI a module or a tool that is missing is a failure: see tests/support/skips.hpp."""
import importlib.util
import os
import shutil

import pytest


def in_ci():
    return os.environ.get("CI", "") not in ("", "0", "false")


def needs(found, name):
    """Skips the test where a tool has not been found; fails it in CI."""
    if found:
        return
    if in_ci():
        pytest.fail(f"missing tool: {name} (CI is set)")
    pytest.skip(f"missing tool: {name}")


def needs_module(name):
    """Skips the test where a Python module is missing; fails it in CI."""
    needs(importlib.util.find_spec(name), f"Python's {name}")


def needs_program(name):
    """Skips the test where a program is not on the path; fails it in CI."""
    needs(shutil.which(name), name)


def pytest_runtest_logreport(report):
    file = os.environ.get("PHYXEL_SKIPS")
    if report.skipped and file:
        reason = report.longrepr[2] if isinstance(report.longrepr, tuple) else str(report.longrepr)
        with open(file, "a") as out:
            out.write(f"Python.{report.nodeid.split('::')[-1]}\t{reason.removeprefix('Skipped: ')}\n")
