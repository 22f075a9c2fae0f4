#!/usr/bin/env bash
# Install brrp into a virtual environment of its own, with the versions that the tests pass with.
#
#   bash tools/install.sh [FOLDER [EXTRA]]     FOLDER: .venv; EXTRA: "dev" adds what the tests need
#
# Needs Python 3.11 or 3.12 (PYTHON=... names one). Open3D and pymeshlab need four system libraries
# (X11, GL, OpenGL, OpenMP), also where nothing is ever shown on a screen: those that the machine
# lacks are installed with apt-get, and named first.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
folder="${1:-.venv}"
extra="${2:+[$2]}"

fail() {
    echo "Error: $1" >&2
    echo "  fix: $2" >&2
    exit 1
}

python=""
for candidate in ${PYTHON:-python3.11 python3.12 python3}; do
    if "$candidate" -c 'import sys; sys.exit(not (3, 11) <= sys.version_info < (3, 13))' 2>/dev/null; then
        python="$candidate"
        break
    fi
done
[ -n "$python" ] || fail "Python 3.11 or 3.12 was not found (tried: ${PYTHON:-python3.11 python3.12 python3})" \
    "sudo apt-get install python3.11 python3.11-venv, or PYTHON=/path/to/python bash $0"

missing=()
"$python" -c 'import ensurepip, venv' 2>/dev/null ||
    missing+=("python$("$python" -c 'import sys; print("%d.%d" % sys.version_info[:2])')-venv")
while read -r library package; do
    "$python" -c 'import ctypes, sys; ctypes.CDLL(sys.argv[1])' "$library" 2>/dev/null ||
        missing+=("$package")
done <<'LIBRARIES'
libX11.so.6 libx11-6
libGL.so.1 libgl1
libOpenGL.so.0 libopengl0
libgomp.so.1 libgomp1
LIBRARIES

if [ "${#missing[@]}" -gt 0 ]; then
    echo "System packages that this machine lacks: ${missing[*]}" >&2
    as_root=()
    [ "$(id -u)" -eq 0 ] || as_root=(sudo)
    install=(apt-get install -y --no-install-recommends "${missing[@]}")
    { type apt-get "${as_root[@]}" 2>/dev/null && "${as_root[@]}" apt-get update -qq &&
        "${as_root[@]}" "${install[@]}" -qq; } >/dev/null ||
        fail "The missing system packages could not be installed" \
            "have an administrator run: apt-get update && ${install[*]}; then run this again"
fi

# What an older checkout left in build/ would be packed into the new installation.
rm -rf build
"$python" -m venv "$folder"
"$folder/bin/pip" install --quiet --constraint constraints.txt ".$extra"
echo "Installed $("$folder/bin/brrp" --version) into $folder" >&2
