#!/bin/sh
# Mutation testing of one group, for `make mutants`: `tests/tools/mutants/try.sh draws`. cosmic-ray changes files, so it
# gets a copy of the code, .mutants/draws; survivors.txt there lists the changes that no test noticed.
set -eu
config=tests/tools/mutants/$1.toml copy=.mutants/$1
least_killed=${2:-85} # percent
count=${COUNT:-60}    # how many mutants are tried, always the same; "all" takes hours
rm -rf "$copy"
mkdir -p "$copy"
cp -a comms tests pyproject.toml "$copy"
cd "$copy"
cosmic-ray init "$config" session.sqlite
cr-filter-operators session.sqlite tests/tools/mutants/operators.toml
cr-filter-pragma session.sqlite # lines that end with "pragma: no mutate"
[ "$count" = all ] || python - "$count" <<END
import random, sqlite3, sys
session = sqlite3.connect("session.sqlite")
left = session.execute(
    "select job_id from mutation_specs where job_id not in (select job_id from work_results)"
    " order by module_path, operator_name, occurrence"
).fetchall()
others = random.Random(1).sample(left, max(0, len(left) - int(sys.argv[1])))
session.executemany("insert into work_results (job_id, worker_outcome) values (?, 'SKIPPED')", others)
session.commit()
END
cosmic-ray baseline "$config"
cosmic-ray exec "$config" session.sqlite
cr-report --surviving-only --show-diff session.sqlite >survivors.txt
# cr-rate counts what a filter left out as killed, so count here.
outcomes() { cr-report session.sqlite | grep -c "test outcome: $1" || true; }
killed=$(outcomes TestOutcome.KILLED) survived=$(outcomes TestOutcome.SURVIVED)
tried=$((killed + survived))
echo "$1: $killed of $tried mutants killed, $((100 * killed / tried)) %; survivors: $copy/survivors.txt"
[ $((100 * killed)) -ge $((least_killed * tried)) ] || { echo "expected at least $least_killed %"; exit 1; }
