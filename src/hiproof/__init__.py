"""hiproof: HolIstic Parametric ROOFs. Airborne LiDAR point clouds into watertight, semantic LoD2 building models."""

__version__ = "0.1.0"
