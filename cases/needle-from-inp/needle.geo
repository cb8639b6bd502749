// Steel valve needle, lengths in mm: shank D4 x 22 with a spherical tip of radius 2 (pole at
// z = 0) and an armature disc D8 x 2 on top.  needle.inp was made from this by gmsh 4.8.4:
//   gmsh -3 -order 2 needle.geo -format inp -o needle.inp
SetFactory("OpenCASCADE");

Sphere(1) = {0, 0, 2, 2};
Cylinder(2) = {0, 0, 2, 0, 0, 20, 2};
Cylinder(3) = {0, 0, 22, 0, 0, 2, 4};
BooleanUnion(10) = { Volume{1}; Delete; }{ Volume{2, 3}; Delete; };

e = 1e-3;
tip() = Surface In BoundingBox {-2 - e, -2 - e, -e, 2 + e, 2 + e, 2 + e};
top() = Surface In BoundingBox {-4 - e, -4 - e, 24 - e, 4 + e, 4 + e, 24 + e};
Physical Volume("needle") = {10};
Physical Surface("tip") = {tip()};
Physical Surface("top") = {top()};

// 0.08 mm within 0.35 mm of the pole, growing to 1.3 mm
Point(1000) = {0, 0, 0};
Field[1] = Distance;
Field[1].NodesList = {1000};
Field[2] = MathEval;
Field[2].F = "Min(1.3, 0.08 + 0.28 * Max(0, F1 - 0.35))";
Background Field = 2;
Mesh.CharacteristicLengthExtendFromBoundary = 0;
Mesh.CharacteristicLengthFromPoints = 0;
Mesh.CharacteristicLengthFromCurvature = 0;
Mesh.Algorithm = 6;
Mesh.Optimize = 1;
Mesh.HighOrderOptimize = 1;
