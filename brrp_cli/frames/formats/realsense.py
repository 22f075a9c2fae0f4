"""RealSense recordings as Open3D's realsense_recorder.py leaves them: color/NNNNNN.jpg,
depth/NNNNNN.png, aligned to the colour camera, and camera_intrinsic.json of that camera.

The recorder writes raw Z16 and not its unit. D400 cameras count millimetres unless told otherwise;
an L515 counts quarters of one: --depth-scale 0.00025.
"""

from __future__ import annotations

from brrp_cli.frames.recordings import recording

FORMAT = recording(
    "a RealSense recording",
    "camera_intrinsic.json",
    "D400 cameras' unit; an L515 needs --depth-scale 0.00025",
)
