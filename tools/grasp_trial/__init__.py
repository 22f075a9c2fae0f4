"""Grasps that are carried out in MuJoCo on the true objects of a scene."""
