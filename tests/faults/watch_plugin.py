"""pytest plugin: tells the parent which test runs, and which one failed."""

from __future__ import annotations

import os
import time

PATH = os.environ["PLANT_PROGRESS"]


def _say(*words):
    with open(PATH, "a") as stream:
        stream.write("\t".join(map(str, words)) + "\n")


def pytest_runtest_logstart(nodeid):
    _say("start", time.time(), nodeid)


def pytest_runtest_logreport(report):
    if report.outcome == "failed":
        _say("failed", time.time(), report.nodeid)


def pytest_collectreport(report):
    if report.outcome == "failed":
        _say("failed", time.time(), f"collecting {report.nodeid}")
