"""Reads legged robots of any make for the velocity tasks: their legs, the pose in which they stand, feet and drives.

`read` takes URDF or MuJoCo's MJCF. `skeleton` has the robot's geometry as numbers. `legs` finds which joints are legs,
`standing` and `pose` how it stands, and `drives` the gains. `urdf` and `mjcf` know the files, and `rebuilt` a compiled
model, which has none.
"""
