#!/usr/bin/env bash
# Install the project into a fresh virtual environment (.venv-test), then check everything: lint,
# format, types, layers, documentation, the wheel, tests. Arguments go to pytest.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
rm -rf .venv-test
bash tools/install.sh .venv-test dev

bin="$PWD/.venv-test/bin"
# The README's first command, beside the checks. It compiles the inner loops, too, which each of the
# tests' workers would do for itself.
XDG_DATA_HOME="$PWD/.venv-test/data" "$bin/brrp" demo -o .venv-test/demo --quiet &
demo=$!
"$bin/ruff" check .
"$bin/ruff" format --check .
"$bin/mypy"
"$bin/lint-imports"
# mkdocs-material's notice of its own end of life is no fault of these pages.
NO_MKDOCS_2_WARNING=1 "$bin/mkdocs" build --strict --quiet --site-dir .venv-test/site
bash tools/check_wheel.sh .venv-test
wait "$demo"
# Two workers of one thread each: more threads than cores would slow one another down.
# `pytest`, not `python -m pytest`: the installed package is tested, not the checkout.
# It ends with 1 where a test fails and with 5 where none ran.
export OMP_NUM_THREADS=1
# A file's tests go to one worker, so that what they share is made once. By default files of few
# tests come last, and these take longest. A test that hangs tells where it does and ends its
# worker; in another one it would hang as well.
hang=(-o faulthandler_timeout=400 -o faulthandler_exit_on_timeout=true --max-worker-restart 0)
"$bin/pytest" -n 2 --dist loadfile --no-loadscope-reorder "${hang[@]}" "$@"
