// An angle bracket of 80 x 40 x 60 mm with a rib and three holes, of first-order tetrahedra (mm).
// gmsh -3 bracket.geo -o bracket.msh        50 000 of them: gmsh -3 bracket.geo -o fine.msh -setnumber size 2.05
SetFactory("OpenCASCADE");
DefineConstant[ size = 5 ];
wall = 8;
Box(1) = {0, 0, 0, 80, 40, wall};
Box(2) = {0, 0, 0, wall, 40, 60};
// The rib: a triangle between the legs.
Point(1001) = {wall, 16, wall};
Point(1002) = {56, 16, wall};
Point(1003) = {wall, 16, 44};
Line(1001) = {1001, 1002};
Line(1002) = {1002, 1003};
Line(1003) = {1003, 1001};
Curve Loop(1001) = {1001, 1002, 1003};
Plane Surface(1001) = {1001};
rib[] = Extrude {0, 8, 0} { Surface{1001}; };
Cylinder(11) = {66, 20, -1, 0, 0, wall + 2, 6};
Cylinder(12) = {-1, 9, 46, wall + 2, 0, 0, 4};
Cylinder(13) = {-1, 31, 46, wall + 2, 0, 0, 4};
BooleanUnion(21) = { Volume{1}; Delete; }{ Volume{2, rib[1]}; Delete; };
BooleanDifference(22) = { Volume{21}; Delete; }{ Volume{11, 12, 13}; Delete; };
Physical Volume("bracket") = {22};
Mesh.MeshSizeMin = size;
Mesh.MeshSizeMax = size;
Mesh.MshFileVersion = 4.1;
