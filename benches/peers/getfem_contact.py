"""Two cartilages pressed together by GetFEM, beside deformable/tests/calculix.rs: triquadratic elements, neo-Hookean, contact by augmented Lagrangian.

usage: getfem_contact.py layers N       the test's two layers, a quarter of them, N elements through each thickness, with curved elements
       getfem_contact.py CASE.inp       the deck that the test wrote for CalculiX: its hexahedra and surfaces
  needs: apt-get install python3-getfem

Prints the force along the motion [N] and the largest pressure [MPa] on the deformed face: integral of the multiplier about a node over that of the
area.
"""
import re, sys, time
import numpy as np
import getfem as gf

E, NU = 12.0, 0.45
STEPS = 4
TOP, BONE, ALONG_X, ALONG_Y = 1, 2, 3, 4


def region(mesh, test):
    faces = [(c, f) for c, f in mesh.outer_faces().T if test(mesh.pts(mesh.pid_in_faces(np.array([[c], [f]]))))]
    return np.array(faces).T


def flat(axis, at):
    return lambda p: bool(np.all(abs(p[axis] - at) < 1e-6))


def layers(n):
    """A quarter: the flat layer, the bulging one (its face at its bottom), direction and depth."""
    def box(side, count):
        text = 'GT="GT_QK(3,2)";SIZES=[%g,%g,2];NSUBDIV=[%d,%d,%d]' % (side, side, count, count, n)
        return gf.Mesh("import", "structured", text)

    low, high = box(6, 2 * n), box(4, max(3 * n // 2, 1))
    for mesh, top, bone in ((low, 2.0, 0.0), (high, 0.0, 2.0)):
        mesh.set_region(TOP, region(mesh, flat(2, top)))
        mesh.set_region(BONE, region(mesh, flat(2, bone)))
        mesh.set_region(ALONG_X, region(mesh, flat(0, 0.0)))
        mesh.set_region(ALONG_Y, region(mesh, flat(1, 0.0)))
    p = high.pts()
    high.set_pts(p + np.array([0 * p[0], 0 * p[0], 2.0 + (p[0] ** 2 + p[1] ** 2) / 40.0]))
    return low, high, np.array([0.0, 0.0, -0.4]), 4.0


def deck(path):
    """Bodies LOW and HIGH of a deck, and the motion of the second."""
    blocks = {}
    for head, body in re.findall(r"\*([^\n]*)\n((?:[^*][^\n]*\n)*)", open(path).read()):
        blocks.setdefault(head.replace(" ", ""), []).append(body)
    rows = lambda head: [[x.strip() for x in line.split(",") if x.strip()] for line in blocks[head][0].splitlines()]
    bodies = []
    for name in ("LOW", "HIGH"):
        node = {int(r[0]): np.array([float(x) for x in r[1:]]) for r in rows(f"NODE,NSET=N{name}")}
        mesh, convex = gf.Mesh("empty", 3), {}
        for r in rows(f"ELEMENT,TYPE=C3D8R,ELSET=E{name}"):
            e, nodes = int(r[0]), [int(x) for x in r[1:]]
            points = np.array([node[nodes[k]] for k in (0, 1, 3, 2, 4, 5, 7, 6)]).T
            convex[e] = (int(np.ravel(mesh.add_convex(gf.GeoTrans("GT_QK(3,1)"), points))[0]), nodes)
        key = lambda p: tuple(np.round(p, 6))
        bone = {key(node[int(r[0])]) for r in rows(f"NSET,NSET=B{name}")}
        tops = {convex[int(r[0])][0]: {key(node[n]) for n in convex[int(r[0])][1][4:]} for r in rows(f"SURFACE,NAME=S{name}")}
        faces = [(c, f, {key(p) for p in mesh.pts(mesh.pid_in_faces(np.array([[c], [f]]))).T}) for c, f in mesh.outer_faces().T]
        mesh.set_region(TOP, np.array([(c, f) for c, f, at in faces if tops.get(c) == at]).T)
        mesh.set_region(BONE, np.array([(c, f) for c, f, at in faces if at <= bone]).T)
        bodies.append(mesh)
    motion = np.zeros(3)
    for r in rows("BOUNDARY"):
        if r[0] == "BHIGH":
            motion[int(r[1]) - 1] = float(r[3])
    return bodies[0], bodies[1], motion, 1.0


def field(mesh, components, degree):
    fem = gf.MeshFem(mesh, components)
    fem.set_fem(gf.Fem("FEM_QK(3,%d)" % degree))
    return fem


def gauss(mesh, degree):
    return gf.MeshIm(mesh, gf.Integ("IM_GAUSS_PARALLELEPIPED(3,%d)" % degree))


def pressed(low, high, motion, copies, size):
    model = gf.Model("real")
    u = {"u1": field(low, 3, 2), "u2": field(high, 3, 2)}
    within = {"u1": gauss(low, 4), "u2": gauss(high, 4)}
    faces = {"u1": gauss(low, 6), "u2": gauss(high, 6)}
    multiplier = field(high, 3, 1)
    for name, fem in u.items():
        model.add_fem_variable(name, fem)
    model.add_filtered_fem_variable("lam", multiplier, TOP)
    model.add_initialized_data("mu", E / (2 * (1 + NU)))
    model.add_initialized_data("bulk", E / (3 * (1 - 2 * NU)))
    for name in u:
        f = f"(Id(3)+Grad_{name})"
        energy = f"0.5*mu*(Norm_sqr({f})*pow(Det({f}),-2/3)-3)+0.5*bulk*sqr(Det({f})-1)"
        model.add_nonlinear_term(within[name], energy)
    model.add_initialized_data("push", [0, 0, 0])
    model.add_initialized_data("zero", [0, 0, 0])
    model.add_Dirichlet_condition_with_simplification("u1", BONE)
    model.add_Dirichlet_condition_with_simplification("u2", BONE, "push")
    if copies > 1:
        for axis, side in ((0, ALONG_X), (1, ALONG_Y)):
            for name in u:
                normal = np.zeros((3, 3))
                normal[axis, axis] = 1
                model.add_initialized_data(f"normal{axis}{name}", normal)
                model.add_generalized_Dirichlet_condition_with_penalization(within[name], name, 1e6, side, "zero", f"normal{axis}{name}")
    for name, value in (("stiff", E / size), ("friction", 0.0), ("alpha", 1.0)):
        model.add_initialized_data(name, [value])
    contact = model.add_integral_large_sliding_contact_brick_raytracing("stiff", 0.8, "friction", "alpha")
    model.add_slave_contact_boundary_to_large_sliding_contact_brick(contact, faces["u2"], TOP, "u2", "lam")
    model.add_master_contact_boundary_to_large_sliding_contact_brick(contact, faces["u1"], TOP, "u1")
    for k in range(1, STEPS + 1):
        model.set_variable("push", motion * k / STEPS)
        _, fine = model.solve("max_res", 1e-7, "max_iter", 60)
        if not fine:
            sys.exit("no equilibrium")
    return told(model, (u["u2"], model.mesh_fem_of_variable("lam"), field(high, 1, 1)), faces["u2"], motion, copies)


def told(model, fems, integration, motion, copies):
    displacement, multiplier, test = fems
    fields = ["u2", 0, displacement, model.variable("u2"), "lam", 0, multiplier, model.variable("lam")]
    sums = lambda e: np.ravel(gf.asm("generic", integration, 1, f"({e})*Test_t", TOP, *fields, "t", 1, test, np.zeros(test.nbdof())))
    way = motion / np.linalg.norm(motion)
    force = -sum(way[a] * sums(f"lam({a + 1})").sum() for a in range(3))
    f = "(Id(3)+Grad_u2)"
    area = sums(f"Norm(Det({f})*Inv({f})'*Normal)")
    load = sums("Norm(lam)")
    on = area > 1e-9 * area.max()
    return copies * abs(force), (load[on] / area[on]).max()


def main():
    gf.util("trace level", 0)
    start = time.process_time()
    if sys.argv[1] == "layers":
        n = int(sys.argv[2])
        force, peak = pressed(*layers(n), 2.0 / n)
    else:
        force, peak = pressed(*deck(sys.argv[1]), 1.0)
    print(f"force {force:.2f} N, largest pressure {peak:.3f} MPa, {time.process_time() - start:.0f} s")


main()
