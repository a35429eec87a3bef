#!/bin/sh
# Routes by babeld, and a Python program beside it: mesh.sh PROGRAM ARGUMENTS. The file `started` has its start in ns.
date +%s%N > "$ROBOT_SCRATCH/started"
babeld -D -I "$ROBOT_SCRATCH/babeld.pid" -S '' -h 1 -H 1 -L "$ROBOT_SCRATCH/babeld.log" \
    -C 'default type wireless' "$ROBOT_INTERFACE"
exec "${PYTHON:-python3}" "$@"
