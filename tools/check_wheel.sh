#!/usr/bin/env bash
# Build the sdist, and the wheel from the sdist alone; install the wheel into a fresh virtual
# environment away from the checkout, and run the demo from there.
#
#   bash tools/check_wheel.sh FOLDER [DIST]    FOLDER: virtual environment made by install.sh with
#                                              "dev"; its libraries serve the new one too, for they
#                                              are a gigabyte. DIST: keeps both files.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
bin="$(realpath "$1")/bin"
away="$(mktemp -d)"
trap 'rm -rf "$away"' EXIT
dist="$(realpath "${2:-$away/dist}")"

# As in install.sh: what an older checkout left there would be packed.
rm -rf build
"$bin/python" -m build --no-isolation --outdir "$dist" . >"$away/build.log" ||
    { cat "$away/build.log" >&2; exit 1; }
rm -rf build

cd "$away"
"$bin/python" -m venv --without-pip venv
"$bin/pip" --quiet --python venv install --no-deps "$dist"/brrp_cli-*.whl
libraries="$("$bin/python" -c 'import sysconfig; print(sysconfig.get_path("purelib"))')"
own="$(venv/bin/python -c 'import sysconfig; print(sysconfig.get_path("purelib"))')"
# Entries of a .pth file come after the environment's own packages: the wheel's brrp is found first.
echo "$libraries" >"$own/libraries.pth"

export XDG_DATA_HOME="$away/data" XDG_CACHE_HOME="$away/cache"
unset PYTHONPATH
venv/bin/python - <<'PYTHON'
import sys
from pathlib import Path

import brrp_cli
from brrp_cli.prior.build.descriptions import YCB_MANIFEST
from brrp_cli.retrieval.clip.manifest import MANIFEST as CLIP
from brrp_cli.segmentation.prompted.mask_files import MANIFEST as MASKS

package = Path(brrp_cli.__file__).parent
assert package.is_relative_to(sys.prefix), f"{package} is not the wheel's"
view = [package / "view/assets/three.min.js", package / "view/assets/three.LICENSE"]
for path in (YCB_MANIFEST, CLIP, MASKS, package / "completion/weights.npz", package / "completion/shapes.safetensors", package / "segmentation/affinities.onnx", package / "segmentation/affinities_walled.onnx", package / "methods/pointsdf/tabletop.safetensors", package / "py.typed", *view):
    assert path.is_file() and path.is_relative_to(package), f"the wheel lacks {path}"
PYTHON
venv/bin/brrp --version
venv/bin/brrp demo -o demo
ls "$dist"
