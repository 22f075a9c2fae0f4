#!/usr/bin/env bash
# Make brrp_cli/view/assets/three.min.js anew: what the page of `brrp view` uses of three.js, in one
# file. Needs node and npm; brrp itself needs neither.
#
#   bash tools/vendor_three.sh
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
three=0.187.0
esbuild=0.28.2
assets="$PWD/brrp_cli/view/assets"
work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT

cd "$work"
npm init -y >/dev/null
npm install --silent --no-audit --no-fund "three@$three" "esbuild@$esbuild"
cat >entry.js <<'ENTRY'
export {
  AmbientLight, BufferAttribute, ColorManagement, DirectionalLight, DoubleSide, Group,
  LinearSRGBColorSpace, Matrix4, Mesh, MeshLambertMaterial, PerspectiveCamera, Points,
  PointsMaterial, Raycaster, Scene, Vector2, Vector3, WebGLRenderer,
} from "three";
export { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
export { GLTFLoader } from "three/examples/jsm/loaders/GLTFLoader.js";
ENTRY
npx esbuild entry.js --bundle --minify --format=iife --global-name=THREE --charset=ascii \
    --banner:js="/*! three.js $three, MIT, https://threejs.org; see three.LICENSE */" \
    --outfile=three.min.js
cp three.min.js "$assets/three.min.js"
cp node_modules/three/LICENSE "$assets/three.LICENSE"
