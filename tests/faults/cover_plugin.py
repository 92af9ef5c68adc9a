"""pytest plugin: one coverage context a test, one for each fixture that several tests share."""

from __future__ import annotations

import json
import os

import coverage
import pytest

SHARED = {"class", "module", "package", "session"}
tests: dict = {}
stack: list = []


def _switch(name):
    current = coverage.Coverage.current()
    if current is not None:
        current.switch_context(name)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item, nextitem):
    entry = {"file": item.nodeid.split("::")[0], "seconds": 0.0, "ok": True, "shared": []}
    tests[item.nodeid] = entry
    info = getattr(item, "_fixtureinfo", None)
    if info is not None:
        for name in item.fixturenames:
            defs = info.name2fixturedefs.get(name) or ()
            for one in defs:
                if one.scope in SHARED:
                    entry["shared"].append(f"fixture|{one.baseid}|{one.argname}")
    stack.append(item.nodeid)
    _switch(item.nodeid)
    try:
        return (yield)
    finally:
        stack.pop()
        _switch("")


@pytest.hookimpl(wrapper=True)
def pytest_fixture_setup(fixturedef, request):
    if fixturedef.scope not in SHARED:
        return (yield)
    name = f"fixture|{fixturedef.baseid}|{fixturedef.argname}"
    stack.append(name)
    _switch(name)
    try:
        return (yield)
    finally:
        stack.pop()
        _switch(stack[-1] if stack else "")


def pytest_runtest_logreport(report):
    entry = tests[report.nodeid]
    entry["seconds"] += report.duration
    entry["ok"] = entry["ok"] and report.outcome == "passed"


def pytest_sessionfinish(session):
    with open(os.environ["PLANT_TESTS"], "w") as stream:
        json.dump(tests, stream)
