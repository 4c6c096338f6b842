#!/usr/bin/env python3
"""Makes the CAD files in jobs/cad and, with them, tests/golden/cad_points.txt: points and normals of each face, evaluated
by the kernel (OpenCASCADE), as the reference for the import.

    python3 -m venv target/cad && target/cad/bin/pip install cadquery-ocp==8.0.1.1.0 rhino3dm==8.35.0
    target/cad/bin/python scripts/make_cad.py

Only needed to change the files; the tests read the committed ones. Lengths are mm.
"""

import math
import pathlib
import re
import sys

import rhino3dm
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Surface
from OCP.BRepAlgoAPI import BRepAlgoAPI_Cut
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeEdge, BRepBuilderAPI_MakeFace, BRepBuilderAPI_MakeWire
from OCP.BRepClass import BRepClass_FaceClassifier
from OCP.BRepOffsetAPI import BRepOffsetAPI_ThruSections
from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox, BRepPrimAPI_MakeCylinder, BRepPrimAPI_MakeRevol, BRepPrimAPI_MakeSphere
from OCP.BRepTools import BRepTools
from OCP.Geom import (
    Geom_BSplineCurve,
    Geom_BSplineSurface,
    Geom_OffsetSurface,
    Geom_SurfaceOfLinearExtrusion,
    Geom_SurfaceOfRevolution,
)
from OCP.gp import gp_Ax1, gp_Ax2, gp_Dir, gp_Pnt, gp_Pnt2d, gp_Trsf, gp_Vec
from OCP.GC import GC_MakeArcOfCircle
from OCP.IFSelect import IFSelect_RetDone
from OCP.IGESControl import IGESControl_Writer
from OCP.Interface import Interface_Static
from OCP.STEPCAFControl import STEPCAFControl_Writer
from OCP.STEPControl import STEPControl_AsIs, STEPControl_Controller, STEPControl_Writer
from OCP.TCollection import TCollection_ExtendedString
from OCP.TDocStd import TDocStd_Document
from OCP.TopAbs import TopAbs_FACE, TopAbs_IN, TopAbs_REVERSED
from OCP.TopExp import TopExp_Explorer
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS, TopoDS_Compound
from OCP.BRep import BRep_Builder
from OCP.XCAFDoc import XCAFDoc_DocumentTool
from OCP.collections import Array1_double, Array1_gp_Pnt, Array1_int, Array2_double, Array2_gp_Pnt

ROOT = pathlib.Path(__file__).resolve().parent.parent
CAD = ROOT / "jobs" / "cad"
POINTS = ROOT / "tests" / "golden" / "cad_points.txt"
INCH = 25.4
# Reference points per side of the grid on each face.
GRID = 7


def array1(kind, values):
    out = kind(1, len(values))
    for i, value in enumerate(values):
        out.SetValue(i + 1, value)
    return out


def spline_surface(poles, degree_u, degree_v, weights=None, inner_u=None, inner_v=None):
    """A clamped B-spline surface on [0, 1]²; interior knots uniform unless given."""
    rows, columns = len(poles), len(poles[0])
    grid = Array2_gp_Pnt(1, rows, 1, columns)
    factors = Array2_double(1, rows, 1, columns)
    for i, row in enumerate(poles):
        for j, pole in enumerate(row):
            grid.SetValue(i + 1, j + 1, gp_Pnt(*pole))
            factors.SetValue(i + 1, j + 1, weights[i][j] if weights else 1.0)

    def axis(count, degree, inner):
        spans = count - degree
        inner = inner or [k / spans for k in range(1, spans)]
        assert len(inner) == spans - 1
        knots = [0.0, *inner, 1.0]
        multiplicities = [degree + 1] + [1] * len(inner) + [degree + 1]
        return array1(Array1_double, knots), array1(Array1_int, multiplicities)

    knots_u, mults_u = axis(rows, degree_u, inner_u)
    knots_v, mults_v = axis(columns, degree_v, inner_v)
    return Geom_BSplineSurface(grid, factors, knots_u, knots_v, mults_u, mults_v, degree_u, degree_v)


def spline_curve(poles, degree):
    spans = len(poles) - degree
    knots = [k / spans for k in range(spans + 1)]
    mults = [degree + 1] + [1] * (spans - 1) + [degree + 1]
    return Geom_BSplineCurve(
        array1(Array1_gp_Pnt, [gp_Pnt(*p) for p in poles]),
        array1(Array1_double, knots),
        array1(Array1_int, mults),
        degree,
    )


def face(surface):
    return BRepBuilderAPI_MakeFace(surface, 1e-6).Face()


def compound(shapes):
    out, builder = TopoDS_Compound(), BRep_Builder()
    builder.MakeCompound(out)
    for shape in shapes:
        builder.Add(out, shape)
    return out


def placed(shape, axis, angle, move):
    turn, shift = gp_Trsf(), gp_Trsf()
    turn.SetRotation(gp_Ax1(gp_Pnt(0, 0, 0), gp_Dir(*axis)), angle)
    shift.SetTranslation(gp_Vec(*move))
    return TopLoc_Location(shift.Multiplied(turn))


# The parts


def mouse_poles():
    """The shell of a computer mouse, 82 x 47 x 23 mm: the height function of jobs/freeform.toml at its poles."""
    text = (ROOT / "jobs" / "freeform.toml").read_text()
    text = "\n".join(line.split("#")[0] for line in text.splitlines())
    numbers = [float(n) for n in re.findall(r"-?\d+\.?\d*", text.split("poles_mm = ")[1].split("[tool]")[0])]
    poles = [tuple(numbers[i : i + 3]) for i in range(0, len(numbers), 3)]
    assert len(poles) == 121
    return [poles[i : i + 11] for i in range(0, 121, 11)]


MOUSE_U = [0.12, 0.25, 0.4, 0.52, 0.64, 0.78, 0.9]
MOUSE_V = [0.09, 0.21, 0.35, 0.5, 0.65, 0.79, 0.91]


def mouse():
    return face(spline_surface(mouse_poles(), 3, 3, inner_u=MOUSE_U, inner_v=MOUSE_V))


def blade():
    """A turbine blade, 80 mm high: five sections of a cambered profile that turns by 35 degrees, lofted to a solid."""
    loft = BRepOffsetAPI_ThruSections(True, False, 1e-6)
    loft.SetMaxDegree(3)
    for k in range(5):
        share = k / 4
        chord, twist, height = 40 - 14 * share, math.radians(35) * share - 0.3, 80 * share
        camber, thickness = 0.14 - 0.05 * share, 0.16 - 0.07 * share

        # The same knots in all sections, so that the loft keeps them.
        def side(sign):
            poles = []
            for i in range(9):
                s = 0.5 - 0.5 * math.cos(math.pi * i / 8)
                mean, half = 4 * camber * s * (1 - s), 4 * thickness * s * (1 - s) * (1.15 - 0.5 * s)
                x, y = chord * (s - 0.4), chord * (mean + 0.5 * sign * half)
                poles.append((x * math.cos(twist) - y * math.sin(twist), x * math.sin(twist) + y * math.cos(twist), height))
            return BRepBuilderAPI_MakeEdge(spline_curve(poles, 3)).Edge()

        loft.AddWire(BRepBuilderAPI_MakeWire(side(1), side(-1)).Wire())
    loft.Build()
    return loft.Shape()


def hood_surface():
    """A car-hood panel, 1.2 m x 0.9 m, of degree 5 by 5 with 3 by 2 spans."""
    poles = []
    for i in range(8):
        row = []
        for j in range(7):
            s, t = i / 7, j / 6 * 2 - 1
            bulge = 22 * math.exp(-(((abs(t) - 0.45) / 0.25) ** 2)) * s * (1 - 0.4 * s)
            row.append((1200 * s, 450 * t * (1 - 0.12 * s), 180 * (1 - (1 - s) ** 2.2) * (1 - 0.35 * t * t) + bulge))
        poles.append(row)
    return spline_surface(poles, 5, 5)


def hood():
    """The panel with a round cut-out in the middle, for an air intake, and the same panel whole, 60 mm above."""
    panel = face(hood_surface())
    cut = BRepAlgoAPI_Cut(panel, BRepPrimAPI_MakeCylinder(gp_Ax2(gp_Pnt(600, 0, -500), gp_Dir(0, 0, 1)), 120, 2000).Shape()).Shape()
    up = gp_Trsf()
    up.SetTranslation(gp_Vec(0, 0, 60))
    return compound([cut, panel.Moved(TopLoc_Location(up))])


def lens_mould():
    """A mould insert for a lens: an aspheric cavity (spline turned about z) with a spherical centre, a rounded rim, a conical
    and a cylindrical wall."""

    def line(a, b):
        return BRepBuilderAPI_MakeEdge(gp_Pnt(*a), gp_Pnt(*b)).Edge()

    def arc(a, b, c):
        return BRepBuilderAPI_MakeEdge(GC_MakeArcOfCircle(gp_Pnt(*a), gp_Pnt(*b), gp_Pnt(*c)).Value()).Edge()

    radius = 60.0
    sphere = lambda a: (radius * math.sin(a), 0, radius - radius * math.cos(a))
    inner = sphere(0.2)
    outer = (24.0, 0, 7.5)
    slope = math.tan(0.2)
    aspheric = spline_curve(
        [inner, (inner[0] + 3, 0, inner[2] + 3 * slope), (18.5, 0, 2.9), (21.5, 0, 4.9), outer], 3
    )
    rim, edge = (26.0, 0, 9.0), (28.0, 0, 8.0)
    edges = [
        line((0, 0, -30), (0, 0, 0)),
        arc((0, 0, 0), sphere(0.1), inner),
        BRepBuilderAPI_MakeEdge(aspheric).Edge(),
        arc(outer, (24.9, 0, 8.6), rim),
        line(rim, edge),
        line(edge, (32, 0, -10)),
        line((32, 0, -10), (32, 0, -30)),
        line((32, 0, -30), (0, 0, -30)),
    ]
    wire = BRepBuilderAPI_MakeWire()
    for part in edges:
        wire.Add(part)
    profile = BRepBuilderAPI_MakeFace(wire.Wire()).Face()
    return BRepPrimAPI_MakeRevol(profile, gp_Ax1(gp_Pnt(0, 0, 0), gp_Dir(0, 0, 1))).Shape()


def swept():
    """Surfaces that are made by a sweep: a spline extruded along a line, a spline revolved by 100 degrees, a spline surface's offset,
    and a rational patch of degree 4 by 3."""
    gutter = spline_curve([(0, 0, 0), (12, 0, 9), (20, 0, -7), (34, 0, -3), (41, 0, 8), (55, 0, 5)], 3)
    extruded = Geom_SurfaceOfLinearExtrusion(gutter, gp_Dir(0.2, 1, 0.1))
    profile = spline_curve([(30, 0, 0), (38, 0, 8), (27, 0, 18), (33, 0, 30), (44, 0, 33)], 4)
    turned = Geom_SurfaceOfRevolution(profile, gp_Ax1(gp_Pnt(0, 0, 0), gp_Dir(0, 0, 1)))
    poles = [[(14 * i, 11 * j, 6 * math.sin(0.9 * i + 0.5 * j)) for j in range(6)] for i in range(6)]
    base = spline_surface(poles, 3, 3)
    offset = Geom_OffsetSurface(base, 2.5)
    weights = [[1 + 0.3 * math.cos(i + 2 * j) for j in range(5)] for i in range(6)]
    rational = spline_surface(
        [[(11 * i, 13 * j, 4 * math.cos(0.8 * i) + 3 * math.sin(0.7 * j)) for j in range(5)] for i in range(6)], 4, 3, weights
    )

    def moved(surface, x, y):
        shift = gp_Trsf()
        shift.SetTranslation(gp_Vec(x, y, 0))
        return surface.Transformed(shift)

    return compound(
        [
            BRepBuilderAPI_MakeFace(moved(extruded, 0, -60), 0, 1, 0, 40, 1e-6).Face(),
            BRepBuilderAPI_MakeFace(moved(turned, -90, 0), 0.3, 0.3 + math.radians(100), 0, 1, 1e-6).Face(),
            face(moved(offset, 0, 0)),
            face(moved(rational, 0, 80)),
        ]
    )


def solids():
    """Analytic solids: a block with a ball and a bore cut out of it, and a ball."""
    block = BRepPrimAPI_MakeBox(gp_Pnt(-40, -30, 0), 80, 60, 25).Shape()
    block = BRepAlgoAPI_Cut(block, BRepPrimAPI_MakeSphere(gp_Pnt(-15, 0, 40), 28).Shape()).Shape()
    block = BRepAlgoAPI_Cut(block, BRepPrimAPI_MakeCylinder(gp_Ax2(gp_Pnt(25, 0, -5), gp_Dir(0, 0, 1)), 8, 50).Shape()).Shape()
    ball = BRepPrimAPI_MakeSphere(gp_Pnt(0, 0, 90), 18).Shape()
    return compound([block, ball])


# Writing


def step_settings(schema, unit):
    # The settings are created with the controller.
    STEPControl_Controller.Init_s()
    assert Interface_Static.SetCVal_s("write.step.schema", schema)
    assert Interface_Static.SetCVal_s("write.step.unit", unit)


def write_step(path, shape, schema, unit="MM"):
    step_settings(schema, unit)
    writer = STEPControl_Writer()
    writer.Transfer(shape, STEPControl_AsIs)
    assert writer.Write(str(path)) == IFSelect_RetDone
    plain_header(path)
    return shape


def write_step_assembly(path, parts, schema, unit="MM"):
    """An assembly: each (shape, location) is a part of its own, placed by its occurrence."""
    step_settings(schema, unit)
    document = TDocStd_Document(TCollection_ExtendedString("XmlXCAF"))
    tool = XCAFDoc_DocumentTool.ShapeTool_s(document.Main())
    assembly = tool.NewShape()
    for shape, location in parts:
        label = tool.AddShape(shape, False)
        tool.AddComponent(assembly, label, location)
    tool.UpdateAssemblies()
    writer = STEPCAFControl_Writer()
    writer.Transfer(document, STEPControl_AsIs)
    assert writer.Write(str(path)) == IFSelect_RetDone
    plain_header(path)
    return compound([shape.Located(location) for shape, location in parts])


def write_iges(path, shape, unit="MM", brep=0):
    writer = IGESControl_Writer(unit, brep)
    writer.AddShape(shape)
    writer.ComputeModel()
    assert writer.Write(str(path))
    text = path.read_text()
    path.write_text(re.sub(r"15H\d{8}\.\d{6}", "15H20260101.000000", text))
    return shape


def plain_header(path):
    """Removes the date of writing, which would make the file differ on each run."""
    text = path.read_text()
    text = re.sub(r"LOCAL_TIME\(\d+,\d+", "LOCAL_TIME(0,0", text)
    text = re.sub(r"CALENDAR_DATE\([\d,]+\)", "CALENDAR_DATE(2026,1,1)", text)
    text = re.sub(r"'\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d'", "'2026-01-01T00:00:00'", text)
    path.write_text(text)


def rhino_surface(poles, degree, inner_u, inner_v, scale):
    rows, columns = len(poles), len(poles[0])
    surface = rhino3dm.NurbsSurface.Create(3, False, degree + 1, degree + 1, rows, columns)
    for axis, count, inner in ((surface.KnotsU, rows, inner_u), (surface.KnotsV, columns, inner_v)):
        knots = [0.0] * degree + list(inner) + [1.0] * degree
        assert len(knots) == count + degree - 1
        for i, knot in enumerate(knots):
            axis[i] = knot
    for i, row in enumerate(poles):
        for j, (x, y, z) in enumerate(row):
            surface.Points[i, j] = rhino3dm.Point4d(x * scale, y * scale, z * scale, 1.0)
    return surface


def write_3dm(path):
    """Two objects in inches: the mouse, and a sphere beside it."""
    model = rhino3dm.File3dm()
    model.Settings.ModelUnitSystem = rhino3dm.UnitSystem.Inches
    model.Objects.AddSurface(rhino_surface(mouse_poles(), 3, MOUSE_U, MOUSE_V, 1 / INCH))
    ball = rhino3dm.Sphere(rhino3dm.Point3d(6, 0, 0), 0.75)
    model.Objects.AddBrep(ball.ToBrep())
    assert model.Write(str(path), 7)
    sphere = BRepPrimAPI_MakeSphere(gp_Pnt(6 * INCH, 0, 0), 0.75 * INCH).Shape()
    return compound([mouse(), sphere])


def write_3dm_objects(path):
    """Documents of Rhino with other objects than polysurfaces, in mm: for tests of what is read, what is left out, and what is told."""
    model = rhino3dm.File3dm()
    model.Settings.ModelUnitSystem = rhino3dm.UnitSystem.Millimeters

    def cylinder(x):
        circle = rhino3dm.Circle(rhino3dm.Point3d(x, 0, 0), 5).ToNurbsCurve()
        return rhino3dm.Extrusion.Create(circle, 5, True)

    def named(name, visible=True):
        attributes = rhino3dm.ObjectAttributes()
        attributes.Name = name
        attributes.Visible = visible
        return attributes

    pad = named("pad")
    pad.ColorSource = rhino3dm.ObjectColorSource.ColorFromObject
    pad.ObjectColor = (255, 128, 0, 255)
    model.Objects.AddExtrusion(cylinder(0), pad)
    corners = rhino3dm.BoundingBox(20, 0, 0, 30, 10, 10)
    model.Objects.AddBrep(rhino3dm.Brep.CreateFromBox(rhino3dm.Box(corners)), named("block"))
    model.Objects.AddExtrusion(cylinder(40), named("guard", visible=False))
    mesh = rhino3dm.Mesh()
    for x, y in ((60, 0), (70, 0), (60, 10)):
        mesh.Vertices.Add(x, y, 0)
    mesh.Faces.AddFace(0, 1, 2)
    model.Objects.AddMesh(mesh, named("scan"))
    # A block with a text dot, which the reader's library does not read: it leaves out the whole block.
    dot = rhino3dm.TextDot("M6", rhino3dm.Point3d(0, 0, 0))
    origin = rhino3dm.Point3d(0, 0, 0)
    members = (cylinder(0), dot)
    clip = model.InstanceDefinitions.Add("clip", "", "", "", origin, members, (named("clip"), named("text")))
    place = rhino3dm.InstanceReference(model.InstanceDefinitions[clip].Id, rhino3dm.Transform.Translation(80, 0, 0))
    model.Objects.AddInstanceObject(place, named("clip"))
    model.Objects.AddTextDot("note", origin)
    assert model.Write(str(path / "objects.3dm"), 7)
    model = rhino3dm.File3dm()
    model.Settings.ModelUnitSystem = rhino3dm.UnitSystem.Millimeters
    model.Objects.AddMesh(mesh, named("scan"))
    assert model.Write(str(path / "mesh.3dm"), 7)


# Reference points


def reference(out, name, shape):
    explorer = TopExp_Explorer(shape, TopAbs_FACE)
    number = 0
    while explorer.More():
        part = TopoDS.Face(explorer.Current())
        explorer.Next()
        number += 1
        adaptor = BRepAdaptor_Surface(part)
        u0, u1, v0, v1 = BRepTools.UVBounds_s(part)
        sign = -1.0 if part.Orientation() == TopAbs_REVERSED else 1.0
        for i in range(GRID):
            for j in range(GRID):
                # Avoids the middle and the boundary, where knots and seams are.
                u = u0 + (u1 - u0) * (i + 0.37) / GRID
                v = v0 + (v1 - v0) * (j + 0.41) / GRID
                if BRepClass_FaceClassifier(part, gp_Pnt2d(u, v), 1e-7).State() != TopAbs_IN:
                    continue
                point, along, across = gp_Pnt(), gp_Vec(), gp_Vec()
                adaptor.D1(u, v, point, along, across)
                normal = along.Crossed(across)
                if normal.Magnitude() < 1e-9:
                    continue
                # Transformed faces that are mirrored do not occur here.
                normal.Normalize()
                normal.Multiply(sign)
                numbers = [point.X(), point.Y(), point.Z(), normal.X(), normal.Y(), normal.Z()]
                out.append(f"{name} {number} " + " ".join(f"{n:.15g}" for n in numbers))
    return number


def main():
    CAD.mkdir(exist_ok=True)
    shapes = {
        "mouse.step": write_step(CAD / "mouse.step", mouse(), "AP203", "INCH"),
        "mouse.igs": write_iges(CAD / "mouse.igs", mouse()),
        "mouse.3dm": write_3dm(CAD / "mouse.3dm"),
        "blade.step": write_step_assembly(
            CAD / "blade.step",
            [
                (blade(), placed(None, (1, 0, 0), math.radians(90), (150, -40, 60))),
                (solids(), placed(None, (0, 0, 1), math.radians(30), (-80, 60, 10))),
            ],
            "AP214IS",
        ),
        "hood.step": write_step(CAD / "hood.step", hood(), "AP214IS", "M"),
        "hood.igs": write_iges(CAD / "hood.igs", hood(), "IN"),
        "lens_mould.step": write_step(CAD / "lens_mould.step", lens_mould(), "AP242DIS"),
        "swept.step": write_step(CAD / "swept.step", swept(), "AP242DIS"),
        "swept.igs": write_iges(CAD / "swept.igs", swept()),
    }
    write_3dm_objects(ROOT / "tests" / "import")
    lines = [
        "# Points of the faces in jobs/cad, evaluated by OpenCASCADE; made by scripts/make_cad.py.",
        "# file, face in the kernel's own order, point (mm), unit normal out of the solid or as the face is turned",
    ]
    for name, shape in shapes.items():
        count = reference(lines, name, shape)
        print(f"{name}: {count} faces, {(CAD / name).stat().st_size} bytes", file=sys.stderr)
    POINTS.write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
