"""Linear elasticity: element kernels, assembly, factorisations, static and eigen solutions."""
