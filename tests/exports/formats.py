"""Reads what `export` wrote with programs that are not ours: `formats.py FORMAT FOLDER`. Ends with status 1 where something is wrong, 77 where a reader is not installed."""

import pathlib
import sys
import xml.etree.ElementTree as xml


def missing(name):
    print(f"{name} is not installed")
    sys.exit(77)


def surfaces(folder, ending):
    try:
        import trimesh
    except ImportError:
        missing("trimesh")
    found = {p.stem: trimesh.load(p, process=ending == "stl", force="mesh") for p in sorted(folder.glob(f"*.{ending}"))}
    assert {"femur_bone", "tibia_bone", "femur_contact_1", "tibia_contact_1", "tibia_contact_2"} <= set(found), found
    for name, mesh in found.items():
        assert len(mesh.faces) > 500, name
        if name.endswith("bone"):
            assert mesh.is_watertight and mesh.volume > 1e4, (name, mesh.volume)
    print(f"{ending}: {len(found)} surfaces read by trimesh {trimesh.__version__}")


def glb(folder):
    try:
        import trimesh
    except ImportError:
        missing("trimesh")
    scene = trimesh.load(folder / "model.glb")
    names = set(scene.geometry)
    assert {"femur_bone", "tibia_bone", "femur_contact_1", "fibres"} <= names, names
    size = scene.bounds[1] - scene.bounds[0]
    assert 0.05 < size.max() < 1.0, f"not metres: {size}"
    print(f"glb: {len(names)} nodes read by trimesh {trimesh.__version__}, {size.max():.3f} m tall")


def vtk(folder):
    try:
        import meshio
    except ImportError:
        missing("meshio")
    collection = xml.parse(folder / "model.pvd").getroot()
    files = [d.get("file") for d in collection.iter("DataSet")]
    assert len(files) > 1
    first = None
    for name in files:
        mesh = meshio.read(folder / name)
        kinds = {c.type: len(c.data) for c in mesh.cells}
        assert kinds.get("line", 0) == 30 and kinds.get("triangle", 0) > 1000, kinds
        assert "force_n" in mesh.cell_data and "part" in mesh.cell_data
        first = mesh.points if first is None else first
    assert abs(mesh.points - first).max() > 1.0, "nothing moves"
    print(f"vtk: {len(files)} steps of {kinds} read by meshio {meshio.__version__}")


def febio(folder):
    root = xml.parse(folder / "model.feb").getroot()
    assert root.tag == "febio_spec" and root.get("version") == "4.0"
    # the sections of format 4.0 in the order in which FEBio writes them [https://help.febio.org]
    order = ["Module", "Control", "Globals", "Material", "Mesh", "MeshDomains", "Boundary", "Rigid", "Contact", "Discrete", "LoadData", "Output"]
    assert [s.tag for s in root] == order, [s.tag for s in root]
    mesh = root.find("Mesh")
    nodes = [int(n.get("id")) for n in mesh.iter("node")]
    assert nodes == list(range(1, len(nodes) + 1)), "node ids"
    elements = [e for part in mesh.findall("Elements") for e in part]
    assert [int(e.get("id")) for e in elements] == list(range(1, len(elements) + 1)), "element ids"
    assert all(1 <= int(n) <= len(nodes) for e in elements for n in e.text.split(","))
    parts, domains = {e.get("name") for e in mesh.findall("Elements")}, {d.get("name") for d in root.find("MeshDomains")}
    assert parts == domains, (parts, domains)
    materials = {m.get("name") for m in root.find("Material")}
    assert {d.get("mat") for d in root.find("MeshDomains")} <= materials
    surfaces, pairs = {s.get("name") for s in mesh.findall("Surface")}, mesh.findall("SurfacePair")
    assert all(p.find(k).text in surfaces for p in pairs for k in ("primary", "secondary"))
    assert {c.get("surface_pair") for c in root.find("Contact")} == {p.get("name") for p in pairs}
    sets = {s.get("name") for s in mesh.findall("DiscreteSet")}
    assert {d.get("discrete_set") for d in root.find("Discrete").findall("discrete")} == sets
    for m in root.find("Discrete").findall("discrete_material"):
        x, f = zip(*(tuple(map(float, p.text.split(","))) for p in m.iter("pt")))
        assert all(a < b for a, b in zip(x, x[1:])) and all(a <= b for a, b in zip(f, f[1:])), m.get("name")
    assert {b.get("node_set") for b in root.find("Boundary")} <= {s.get("name") for s in mesh.findall("NodeSet")}
    print(f"febio: {len(nodes)} nodes, {len(elements)} elements, {len(sets)} springs, {len(pairs)} contact pairs; every name is defined")
    febio_sections(root)
    febio_steps(folder, root)


def steps_of(folder):
    """The rows of steps.csv by file."""
    import csv

    files = {}
    for row in csv.DictReader((folder / "steps.csv").open()):
        files.setdefault(row["file"], []).append(row)
    return files


LOADS = ["load_vv_nm", "load_ie_nm", "load_ml_n", "load_ap_n", "load_si_n"]


def febio_steps(folder, knee):
    """A file a protocol: it takes the knee from model.feb, holds steps.csv's flexions and loads, and its joints turn, shift and push in clinical senses."""
    try:
        import numpy as np
    except ImportError:
        missing("numpy")
    # as pyfebio read them, the knee's own sections are cut short
    knee = xml.parse(folder / "model.feb").getroot()
    points = {int(n.get("id")): np.array([float(x) for x in n.text.split(",")]) for n in knee.find("Mesh").iter("node")}
    sets = {s.get("name"): [points[int(n)] for n in s.text.split(",")] for s in knee.find("Mesh").findall("NodeSet")}
    frames = {}
    for bone in ("femur", "tibia"):
        origin, *ends = sets[f"{bone}_anatomical"]
        frames[bone] = origin, np.column_stack([(e - origin) / 100 for e in ends])

    def turned(axis, angle):
        x, y, z = axis
        k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k

    def coordinates(joints, moved):
        """Grood-Suntay coordinates [rad, mm] where each joint turns and shifts its second body [grood1983]."""
        r, p = np.eye(3), np.zeros(3)
        for j, (angle, shift) in zip(joints, moved):
            own = turned(j["axis"], angle)
            r, p = r @ own, r @ (j["origin"] - own @ j["origin"] + shift * j["axis"]) + p
        (fo, fa), (to, ta) = frames["femur"], frames["tibia"]
        f = r @ fa
        m, t = f.T @ ta, f.T @ (to - (r @ fo + p))
        fe, vv, ie = np.arctan2(m[1, 2], m[2, 2]), np.arcsin(m[0, 2]), np.arctan2(-m[0, 1], m[0, 0])
        return np.array([fe, vv, ie, -t[0], t[1] * np.cos(fe) - t[2] * np.sin(fe), m[:, 2] @ t])

    files = steps_of(folder)
    assert set(files) == {p.name for p in folder.glob("*.feb")} - {"model.feb"} and len(files) >= 6, list(files)
    order = ["Module", "Globals", "Material", "Mesh", "MeshDomains", "Boundary", "Rigid", "Contact", "Discrete", "Step", "LoadData", "Output"]
    for name, rows in files.items():
        root = xml.parse(folder / name).getroot()
        assert [s.tag for s in root] == order, [s.tag for s in root]
        for k, section in enumerate(list(root)):
            if section.get("from"):
                assert section.get("from") == "model.feb" and not len(section) and not section.text
                root[k] = knee.find(section.tag)
        assert [int(m.get("id")) for m in root.find("Material")] == list(range(1, 1 + len(root.find("Material")))), name
        materials = {m.get("name") for m in root.find("Material")}
        curves = {c.get("id"): np.array([[float(x) for x in p.text.split(",")] for p in c.iter("pt")]) for c in root.find("LoadData")}
        assert len(curves) == 6 and all((np.diff(c[:, 0]) > 0).all() for c in curves.values()), name
        joints = []
        for c in root.find("Rigid").findall("rigid_connector"):
            text = {e.tag: e.text for e in c}
            lc = {e.tag: (e.get("lc"), float(e.text)) for e in c if e.get("lc")}
            vector = lambda tag: np.array([float(x) for x in text[tag].split(",")])
            assert {text["body_a"], text["body_b"]} <= materials and abs(np.linalg.norm(vector("joint_axis")) - 1) < 1e-9
            joints.append({"origin": vector("joint_origin"), "axis": vector("joint_axis"), "first": text["body_a"], "second": text["body_b"], "lc": lc})
        chain = [joints[0]["first"]] + [j["second"] for j in joints]
        assert (chain[0], chain[-1], len(set(chain))) == ("tibia", "femur", 4) and all(a["second"] == b["first"] for a, b in zip(joints, joints[1:]))
        rest = coordinates(joints, [(0, 0)] * 3)
        for k, j in enumerate(joints):
            for n, tags in enumerate((("moment", "rotation"), ("force",))):
                (tag,) = [t for t in tags if t in j["lc"]]
                curve, value = j["lc"][tag]
                moved = [[0.0, 0.0] for _ in joints]
                moved[k][n] = 1e-4
                change = (coordinates(joints, moved) - rest)[int(curve) - 1] / 1e-4
                # a force pushes the first body, a rotation turns the second
                sense = value if tag == "rotation" else -value
                assert abs(value) == 1 and change * sense > 0.9, (name, tag, curve, change, value)
        assert len(root.find("Step")) == len(rows), name
        for row, step in zip(rows, root.find("Step")):
            steps, size = (float(step.find("Control").findtext(t)) for t in ("time_steps", "step_size"))
            assert step.get("name") == row["name"] and abs(steps * size - (float(row["to_s"]) - float(row["from_s"]))) < 1e-5
            at = lambda id: np.interp(float(row["to_s"]), *curves[id].T)
            moved = [(j["lc"]["rotation"][1] * at(j["lc"]["rotation"][0]) if "rotation" in j["lc"] else 0, 0) for j in joints]
            assert abs(np.degrees(coordinates(joints, moved)[0]) - float(row["fe_deg"])) < 1e-3, (name, row)
            found = [at(str(k + 2)) / (1000 if k < 2 else 1) for k in range(5)]
            assert np.allclose(found, [float(row[c]) for c in LOADS], atol=1e-5), (name, row, found)
    print(f"febio: {len(files)} protocols hold the flexions and loads of steps.csv, in clinical senses")
    febio_sections(root)


def febio_sections(root):
    """Each section as the classes of pyfebio 0.3 have it, values checked, nothing left over. What they cannot read is what they only write:
    flags as text (taken out where they are 0 or 1), a spring's force by points (they know a formula only; checked above) and names of rigid constraints."""
    try:
        import importlib

        import pydantic
        from lxml import etree

        import pyfebio
    except ImportError:
        print("pyfebio is not installed: sections are not checked by it")
        return
    for part in [*root.find("Mesh"), *root.find("Discrete").iter("points")]:
        del part[50:]  # its classes are slow, and all numbers were checked above
    for force in root.find("Discrete").iter("force"):
        force.set("type", "math")
        force[:] = [xml.fromstring("<math>x</math>")]
    for rigid in root.find("Rigid"):
        if rigid.tag != "rigid_connector":
            del rigid.attrib["name"]

    def read(section):
        kind = getattr(importlib.import_module(f"pyfebio.{section.tag.lower()}"), section.tag)
        while True:
            try:
                return kind.from_xml(xml.tostring(section))
            except pydantic.ValidationError as error:
                faults = error.errors()
                flags = {f["loc"][-1] for f in faults if f["msg"].endswith("Input should be 0 or 1") and f["input"] in ("0", "1")}
                found = [(holder, e) for holder in section.iter() for e in list(holder) if e.tag in flags and e.text in ("0", "1")]
                assert found, "\n".join(f"{section.tag}: {f['loc']}: {f['msg']}" for f in faults[:20])
                for holder, e in found:
                    holder.remove(e)

    def facts(e, path=()):
        """Every element by its path, with attributes and text, numbers as numbers."""
        number = lambda t: tuple(float(x) if x.lstrip("-").replace(".", "").replace("e-", "").isdigit() else x for x in t.split(","))
        path = (*path, e.tag)
        yield (path, number((e.text or "").strip())), set(e.attrib.items())
        for c in e:
            yield from facts(c, path)

    for section in root:
        known = {}
        for fact, attributes in facts(etree.fromstring(read(section).to_xml(skip_empty=True))):
            known.setdefault(fact, []).append(attributes)
        lost = [(fact, mine) for fact, mine in facts(section) if not any(mine <= theirs for theirs in known.get(fact, []))]
        assert not lost, f"{section.tag}: pyfebio does not know {lost[:5]}"
    print(f"febio: {len(root)} sections as pyfebio has them")


def abaqus(folder):
    """geometry.inp by meshio as it is; the fibres of the deck by meshio, which needs telling what connectors and masses are and that nodes may stand in
    several blocks (CalculiX 2.20 knows no rigid triangles and no connectors, so it cannot read a knee deck)."""
    try:
        import meshio
        from meshio.abaqus import _abaqus
        import numpy as np
    except ImportError:
        missing("meshio")
    import json
    import tempfile

    alone = meshio.read(folder / "geometry.inp")
    _abaqus.abaqus_to_meshio_type.update({"MASS": "vertex", "ROTARYI": "vertex", "CONN3D2": "line"})
    mains = sorted(p for p in folder.glob("*.inp") if "*STEP" in p.read_text())
    # the paper's protocols: three flexions of AP laxity, passive flexion, the pivot shift; and settling with flexion
    assert len(mains) == 6, mains
    (main,) = [p for p in mains if p.stem.endswith("_settle_flex")]
    included = [line.split("=")[1] for line in main.read_text().splitlines() if line.startswith("*INCLUDE") and "contact" not in line]
    blocks = [("*" + b).splitlines() for name in included for b in (folder / name).read_text().replace("\n**", "\n#").split("\n*")]
    blocks = [[line.lstrip("*") if k else "*" + line.lstrip("*") for k, line in enumerate(b) if not line.startswith("#")] for b in blocks]
    nodes = [line for b in blocks if b[0].upper().startswith("*NODE") for line in b[1:] if line]
    elements = ["\n".join(b) for b in blocks if b[0].upper().startswith("*ELEMENT")]
    with tempfile.NamedTemporaryFile("w", suffix=".inp") as deck:
        deck.write("*HEADING\none block of nodes\n*NODE\n" + "\n".join(nodes) + "\n" + "\n".join(elements) + "\n")
        deck.flush()
        mesh = meshio.read(deck.name)
    triangles = np.concatenate([c.data for c in mesh.cells if c.type == "triangle"])
    for kind in ("triangle", "hexahedron"):
        cells = [np.concatenate([m.points[c.data] for c in m.cells if c.type == kind]) for m in (alone, mesh)]
        assert np.array_equal(*cells), kind
    assert {"CART-FEMUR", "CART-TIBIA-MED", "CART-TIBIA-LAT", "BONE-FEMUR", "BONE-TIBIA"} <= set(alone.cell_sets), list(alone.cell_sets)
    model_path = pathlib.Path(sys.argv[3])
    model = json.loads(model_path.read_text())
    paths = [b["bone"] for b in model["bodies"]] + sorted({p[k] for p in model["contact"]["pairs"] for k in ("femur", "tibia")})
    surfaces = [meshio.read(model_path.parent / p) for p in paths]
    assert len(triangles) == sum(len(s.cells_dict["triangle"]) for s in surfaces), len(triangles)

    def area(points, faces):
        a, b, c = (points[faces[:, k]] for k in range(3))
        return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()

    ours = sum(area(s.points, s.cells_dict["triangle"]) for s in surfaces)
    theirs = area(mesh.points, triangles)
    assert abs(theirs / ours - 1) < 1e-9, (theirs, ours)
    # the cartilages' hexahedra, as many and as large as stage 8 left them
    solids = [meshio.read(model_path.parent / p) for b in model["bodies"] for p in b["cartilage"]]
    hexahedra = sum(len(c.data) for c in mesh.cells if c.type == "hexahedron")
    assert hexahedra == sum(len(s.cells_dict["hexahedron"]) for s in solids) > 1000, hexahedra
    lines = np.concatenate([c.data for c in mesh.cells if c.type == "line"])
    ends = {tuple(np.round(mesh.points[line].ravel(), 6)) for line in lines}
    fibres = [tuple(np.round([*f["femur"], *f["tibia"]], 6)) for f in model["fibres"]]
    lost = [f for f in fibres if f not in ends and f[3:] + f[:3] not in ends]
    assert not lost, lost
    print(f"abaqus: {len(mesh.points)} nodes, {len(triangles)} rigid triangles, {hexahedra} hexahedra, {len(lines)} connectors read by meshio {meshio.__version__}; {len(fibres)} fibres where the model has them")


def opensim(folder):
    try:
        import opensim as osim
    except ImportError:
        missing("opensim")
    import os

    os.chdir(folder)
    osim.Logger.setLevelString("Error")
    model = osim.Model("model.osim")
    state = model.initSystem()
    forces = [model.getForceSet().get(i).getConcreteClassName() for i in range(model.getForceSet().getSize())]
    assert model.getNumCoordinates() == 6 and forces.count("Blankevoort1991Ligament") == 30 and forces.count("ElasticFoundationForce") == 2, forces
    model.realizeDynamics(state)
    print(f"opensim: loaded by {osim.GetVersion()}: {model.getNumBodies()} bodies, 6 coordinates, {len(forces)} forces")


if __name__ == "__main__":
    what, where = sys.argv[1], pathlib.Path(sys.argv[2])
    if what in ("stl", "ply"):
        surfaces(where, what)
    else:
        {"glb": glb, "vtk": vtk, "febio": febio, "abaqus": abaqus, "opensim": opensim}[what](where)
