"""The paper's steps, written down plainly: what `tools/benchmark.py` measures brrp against.

Nothing is kept, shared or simplified: each of 30 registrations computes both clouds' features that
it needs, each SVGD step computes the dense features of its batch, autograd finds the gradients, and
the surface comes from features at every node of a 0.8 m cube. The libraries (Open3D, torch,
scikit-image) and the constants (`preset("paper")`) are those of brrp, and they get all cores.
"""
