"""A first knee in Python: build a synthetic specimen, look at it, load it, change it.

Run it with a folder for the knee and its pictures::

    python first_knee.py my-knee

It needs ``pip install "./python[all]"``, from a clone. Lengths are mm, forces N.
"""

import pathlib
import sys

import matplotlib

matplotlib.use("Agg")  # pictures into files; leave this out in a notebook
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

import genu

folder = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else "my-knee")

# %% A specimen, and its model before calibration (without `to` the build goes on to it, which takes minutes).
# Run it again: what has not changed is not built again.
if not (folder / "specimen.toml").exists():
    genu.phantom("S192803-phantom", folder)
build = genu.build(folder, to="assemble", progress=lambda stage, share, message: print(f"{100 * share:3.0f} %  {stage}: {message}"))
for stage, warnings in build.warnings.items():
    print(f"{stage}: {len(warnings)} warnings, first: {warnings[0]}")

# %% Cartilage thickness, seen along the axes of the bone it covers.
figure, axes = plt.subplots(1, 2, figsize=(10, 4.5), layout="constrained")
places = [("femur", "femur", "Femoral cartilage from below", (0, 1)), ("tibia_medial", "tibia", "Tibial cartilage from above", (0, 1))]
for ax, (name, bone, title, (x, y)) in zip(axes, places):
    inverse = np.linalg.inv(getattr(build.frames, bone))
    for part in (name,) if bone == "femur" else ("tibia_medial", "tibia_lateral"):
        surface = build.surface("cartilage", part)
        points = surface.vertices @ inverse[:3, :3].T + inverse[:3, 3]
        shown = ax.scatter(points[:, x], points[:, y], c=surface.point_data["thickness_mm"], s=2, vmin=0, vmax=3.5, cmap="viridis")
    ax.set(title=title, xlabel="medial [mm]", ylabel="anterior [mm]", aspect="equal")
figure.colorbar(shown, ax=axes, label="thickness [mm]")
figure.savefig(folder / "thickness.png", dpi=110)

# %% A drawer test, as built and with another ACL. The file of the model stays as it is.
model = build.model


def with_acl(factor):
    """The model with its ACL so many times as stiff."""
    other = model.copy()
    for name in ("ACL_AM", "ACL_PL"):
        other.bundle(name)["stiffness_n_per_mm"] *= factor
    return other


pulls = np.linspace(-100.0, 100.0, 11)  # posterior and anterior, N
trials = pd.DataFrame({"load_ap_n": pulls})
trials["trial"] = [f"drawer_{number}" for number in range(len(pulls))]
trials["test"] = np.where(pulls < 0, "posterior", np.where(pulls > 0, "anterior", "neutral"))
trials["nominal_flexion_deg"] = trials["fe_deg"] = 30.0
trials["load_si_n"] = 20.0
trials[["load_vv_nm", "load_ie_nm", "load_ml_n"]] = 0.0
trials[["vv_deg", "ie_deg", "ml_mm", "ap_mm", "si_mm"]] = None  # what a laboratory would have measured

cases = {
    "as built": genu.simulate(model, trials),
    "ACL twice as stiff": genu.simulate(with_acl(2.0), trials),
    "ACL half as stiff": genu.simulate(with_acl(0.5), trials),
}
figure, ax = plt.subplots(figsize=(6.5, 4), layout="constrained")
for label, poses in cases.items():
    ax.plot(poses["ap_mm"], poses["load_ap_n"], marker="o", markersize=4, label=label)
ax.set(xlabel="anterior position of the tibia [mm]", ylabel="anterior force [N]", title="A drawer at 30 deg of flexion")
ax.legend(fontsize=8)
figure.savefig(folder / "drawer.png", dpi=110)

# %% What a laboratory measured, and what this model answers. It is not calibrated: curves and points lie apart.
measured = pd.read_csv(folder / "laxity" / "kla.csv")
answered = genu.simulate(model, measured)
figure, axes = plt.subplots(1, 2, figsize=(10, 4), layout="constrained")
genu.plots.laxity(answered, measured, "ie_deg", ax=axes[0])
genu.plots.forces(genu.simulate(model, protocol="passive-flexion", to_flexion_deg=60), ["ACL", "PCL", "LCL", "sMCL"], ax=axes[1])
figure.savefig(folder / "laxity.png", dpi=110)

# %% What the ligaments carry. This knee is not calibrated: at 60 deg and more it may dislocate under the drawer.
built = cases["as built"]
forces = built[built["load_ap_n"] == built["load_ap_n"].max()].set_index("trial").filter(like="force_")
forces.columns = [c.removeprefix("force_").removesuffix("_n") for c in forces.columns]
print("Forces under the anterior drawer [N]:")
print(forces.round(1).to_string())
print(f"Look at {folder / 'thickness.png'}, {folder / 'drawer.png'}, {folder / 'laxity.png'} and {build.report}")
