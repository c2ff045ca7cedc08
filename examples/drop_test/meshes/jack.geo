// A jack, 60 mm wide: three rods with round ends along the axes, grown together, of first-order tetrahedra (mm).
// gmsh -3 jack.geo -o jack.msh        finer: gmsh -3 jack.geo -o jack.msh -setnumber size 1.5
SetFactory("OpenCASCADE");
DefineConstant[ size = 4.5 ];
arm = 24; radius = 6;
Cylinder(1) = {-arm, 0, 0, 2 * arm, 0, 0, radius};
Cylinder(2) = {0, -arm, 0, 0, 2 * arm, 0, radius};
Cylinder(3) = {0, 0, -arm, 0, 0, 2 * arm, radius};
Sphere(4) = {-arm, 0, 0, radius};
Sphere(5) = {arm, 0, 0, radius};
Sphere(6) = {0, -arm, 0, radius};
Sphere(7) = {0, arm, 0, radius};
Sphere(8) = {0, 0, -arm, radius};
Sphere(9) = {0, 0, arm, radius};
BooleanUnion(10) = { Volume{1}; Delete; }{ Volume{2:9}; Delete; };
Physical Volume("jack") = {10};
Mesh.MeshSizeMin = size;
Mesh.MeshSizeMax = size;
Mesh.MshFileVersion = 4.1;
