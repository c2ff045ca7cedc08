// A cup, 80 mm wide and 90 mm high, with a wall of 4 mm and a bottom of 6 mm, of first-order hexahedra (mm).
// gmsh -3 cup.geo -o cup.msh -bin
//
// The bottom is a square of hexahedra within a ring of them, so that there is no axis at which they degenerate.
DefineConstant[ around = 6, up = 12 ];
radius = 40; wall = 4; bottom = 6; height = 90;
inner = radius - wall; core = 0.55 * inner; d = Sqrt(0.5);
Point(1) = {0, 0, 0};
Point(2) = {core * d, core * d, 0};
Point(3) = {-core * d, core * d, 0};
Point(4) = {-core * d, -core * d, 0};
Point(5) = {core * d, -core * d, 0};
Point(6) = {inner * d, inner * d, 0};
Point(7) = {-inner * d, inner * d, 0};
Point(8) = {-inner * d, -inner * d, 0};
Point(9) = {inner * d, -inner * d, 0};
Point(10) = {radius * d, radius * d, 0};
Point(11) = {-radius * d, radius * d, 0};
Point(12) = {-radius * d, -radius * d, 0};
Point(13) = {radius * d, -radius * d, 0};
For k In {0:3}
  next = (k + 1) % 4;
  Line(1 + k) = {2 + k, 2 + next};
  Circle(11 + k) = {6 + k, 1, 6 + next};
  Circle(21 + k) = {10 + k, 1, 10 + next};
  Line(31 + k) = {2 + k, 6 + k};
  Line(41 + k) = {6 + k, 10 + k};
EndFor
Curve Loop(1) = {1, 2, 3, 4};
Plane Surface(1) = {1};
For k In {0:3}
  next = (k + 1) % 4;
  Curve Loop(11 + k) = {31 + k, 11 + k, -(31 + next), -(1 + k)};
  Plane Surface(11 + k) = {11 + k};
  Curve Loop(21 + k) = {41 + k, 21 + k, -(41 + next), -(11 + k)};
  Plane Surface(21 + k) = {21 + k};
EndFor
Transfinite Curve{1:4, 11:14, 21:24} = around + 1;
Transfinite Curve{31:34} = around / 2 + 1;
Transfinite Curve{41:44} = 2;
Transfinite Surface{1, 11:14, 21:24};
Recombine Surface{1, 11:14, 21:24};
floor[] = Extrude {0, 0, bottom} { Surface{1, 11:14, 21:24}; Layers{2}; Recombine; };
// Above the outer ring of the bottom stands the wall; floor[0], floor[6], … are the upper sides.
side[] = Extrude {0, 0, height - bottom} { Surface{floor[30], floor[36], floor[42], floor[48]}; Layers{up}; Recombine; };
Physical Volume("cup") = Volume{:};
Mesh.MshFileVersion = 4.1;
