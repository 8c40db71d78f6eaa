#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Prints "passed failed skipped" of a JUnit report that ctest wrote; exit code 1 without any test.

  python3 scripts/count_tests.py build/release/tests.xml

ctest calls both "skipped" and "could not be run" notrun. A test that skipped itself is known by the
rule that matched, one that is switched off is disabled; every other test that did not run failed.
"""
import argparse
import pathlib
import sys
import xml.etree.ElementTree


def outcome(case):
    if case.get("status") == "run" and case.find("failure") is None:
        return "passed"
    skipped = case.find("skipped")
    if case.get("status") == "disabled":
        return "skipped"
    if skipped is not None and skipped.get("message", "").startswith("SKIP_"):
        return "skipped"
    return "failed"


def main():
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("report", type=pathlib.Path, help="what ctest --output-junit wrote")
    try:
        cases = list(xml.etree.ElementTree.parse(parser.parse_args().report).iter("testcase"))
    except (OSError, xml.etree.ElementTree.ParseError) as error:
        print("count_tests: %s" % error, file=sys.stderr)
        return 1
    outcomes = [outcome(case) for case in cases]
    print(*(outcomes.count(kind) for kind in ("passed", "failed", "skipped")))
    return 0 if cases else 1


if __name__ == "__main__":
    sys.exit(main())
