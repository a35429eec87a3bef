#!/bin/sh
# Mutation testing of one group, for `make mutants`: `tests/tools/mutants/try.sh draws`. cosmic-ray changes files, so it
# gets a copy of the code, .mutants/draws; survivors.txt there lists the changes that no test noticed.
set -eu
config=tests/tools/mutants/$1.toml copy=.mutants/$1
least_killed=${2:-85} # percent
rm -rf "$copy"
mkdir -p "$copy"
cp -a comms tests pyproject.toml "$copy"
cd "$copy"
cosmic-ray init "$config" session.sqlite
cr-filter-operators session.sqlite tests/tools/mutants/operators.toml
cr-filter-pragma session.sqlite # lines that end with "pragma: no mutate"
cosmic-ray baseline "$config"
cosmic-ray exec "$config" session.sqlite
cr-report --surviving-only --show-diff session.sqlite >survivors.txt
# cr-rate counts what a filter left out as killed, so count here.
count() { cr-report session.sqlite | grep -c "test outcome: $1" || true; }
killed=$(count TestOutcome.KILLED) survived=$(count TestOutcome.SURVIVED)
tried=$((killed + survived))
echo "$1: $killed of $tried mutants killed, $((100 * killed / tried)) %; survivors: $copy/survivors.txt"
[ $((100 * killed)) -ge $((least_killed * tried)) ] || { echo "expected at least $least_killed %"; exit 1; }
