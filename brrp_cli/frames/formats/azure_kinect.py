"""Azure Kinect recordings as Open3D's azure_kinect_mkv_reader.py leaves them: color/NNNNN.jpg,
depth/NNNNN.png in millimetres, aligned to the colour camera, and intrinsic.json of that camera."""

from __future__ import annotations

from brrp_cli.frames.recordings import recording

FORMAT = recording("an Azure Kinect recording", "intrinsic.json", "the Azure Kinect's unit")
