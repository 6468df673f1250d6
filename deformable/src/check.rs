//! Refuses what cannot be simulated, in words that say which solid, node or element and what was expected.

use super::{Assembly, Face, Law, Motion, Options, Scaling, Solid};
use crate::error::DeformableError;
use meshes::Point;

fn fault<T>(message: String) -> Result<T, DeformableError> {
    Err(DeformableError::Spec(message))
}

/// Checks everything but the elements' volumes.
pub(super) fn assembly(a: &Assembly, options: &Options) -> Result<(), DeformableError> {
    check_options(options)?;
    for body in &a.bodies {
        motion(&body.name, &body.motion)?;
    }
    for s in &a.solids {
        solid(s, a.bodies.len())?;
    }
    for f in &a.rigid_faces {
        points(&f.name, &f.nodes)?;
        quads(&f.name, &f.quads, f.nodes.len())?;
        if f.body >= a.bodies.len() {
            return fault(format!("rigid face {}: no body {}", f.name, f.body));
        }
    }
    for face in a.pairs.iter().flatten() {
        let known = match face {
            Face::Articular(n) => a.solids.get(*n).map(|s| (&s.name, &s.mesh.articular_quads)),
            Face::Rigid(n) => a.rigid_faces.get(*n).map(|f| (&f.name, &f.quads)),
        };
        match known {
            None => return fault(format!("contact: no such face {face:?}")),
            Some((name, quads)) if quads.is_empty() => {
                return fault(format!("contact: {name} has no face to touch with"));
            }
            _ => {}
        }
    }
    Ok(())
}

fn check_options(o: &Options) -> Result<(), DeformableError> {
    let within = [
        ("hourglass_stiffness", o.hourglass_stiffness, 0.0, 1.0),
        ("hourglass_viscosity", o.hourglass_viscosity, 0.0, 1.0),
        ("penalty_mpa_per_mm", o.penalty_mpa_per_mm, 1e-3, 1e7),
        ("friction", o.friction, 0.0, 5.0),
        ("deepest_mm", o.deepest_mm, 1e-3, 20.0),
        ("safety", o.safety, 0.01, 1.0),
    ];
    for (name, x, low, high) in within {
        if !(low..=high).contains(&x) {
            return Err(DeformableError::Input(format!("deformable.{name} is {x}, expected {low} to {high}")));
        }
    }
    if let Scaling::AtLeast(dt) | Scaling::Even(dt) = o.scaling
        && !(1e-12..=1.0).contains(&dt)
    {
        return Err(DeformableError::Input(format!("deformable.scaling: increment {dt} s, expected 1e-12 to 1")));
    }
    Ok(())
}

fn motion(name: &str, motion: &Motion) -> Result<(), DeformableError> {
    let finite = |list: &[f64]| list.iter().all(|x| x.is_finite());
    let good = match motion {
        Motion::Fixed => true,
        Motion::Prescribed { turn, about, shift, ramp } => {
            finite(turn.as_slice())
                && finite(about.coords.as_slice())
                && finite(shift.as_slice())
                && finite(&[ramp.from, ramp.to, ramp.start_s, ramp.end_s])
        }
        Motion::Loaded { mass_tonne, inertia_tonne_mm2, guide, force, moment, .. } => {
            if !(*mass_tonne > 0.0 && mass_tonne.is_finite()) {
                return fault(format!("body {name}: mass {mass_tonne} t; a loaded body needs a mass"));
            }
            if guide.is_none() && !(*inertia_tonne_mm2 > 0.0 && inertia_tonne_mm2.is_finite()) {
                return fault(format!("body {name}: rotary inertia {inertia_tonne_mm2} t mm2; a free body needs one"));
            }
            if guide.is_some_and(|g| g.norm().is_nan() || (g.norm() - 1.0).abs() > 1e-6) {
                return fault(format!("body {name}: its guide must be a unit vector"));
            }
            finite(force.as_slice()) && finite(moment.as_slice())
        }
    };
    if good { Ok(()) } else { fault(format!("body {name}: its motion holds a number that is not finite")) }
}

fn solid(s: &Solid, bodies: usize) -> Result<(), DeformableError> {
    let name = &s.name;
    let m = &s.material;
    let within = [
        ("E", m.youngs_modulus_mpa, 0.02, 1e6, "MPa (12 for cartilage; 12e6 Pa is 12 MPa)"),
        ("density", m.density_tonne_mm3, 1e-11, 1e-6, "tonne/mm3 (water is 1e-9; 1000 kg/m3 is 1e-9)"),
    ];
    for (what, x, low, high, unit) in within {
        if !(low..=high).contains(&x) {
            return fault(format!("solid {name}: {what} is {x}, expected {low} to {high} {unit}: check its unit"));
        }
    }
    let nu = m.poissons_ratio;
    if !(nu > -0.99 && nu <= 0.499) {
        return fault(format!("solid {name}: Poisson's ratio is {nu}, expected above -0.99 and at most 0.499"));
    }
    if m.law == Law::NeoHookean && m.lambda() + 2.0 / 3.0 * m.mu() <= 0.0 {
        return fault(format!("solid {name}: bulk modulus is not positive"));
    }
    points(name, &s.mesh.nodes)?;
    let count = s.mesh.nodes.len();
    if s.mesh.elements.is_empty() {
        return fault(format!("solid {name} has no elements"));
    }
    if let Some(e) = s.mesh.elements.iter().position(|e| e.iter().any(|&n| n as usize >= count)) {
        return fault(format!("solid {name}: element {e} names a node that is not there"));
    }
    quads(name, &s.mesh.articular_quads, count)?;
    let fixed = s.mesh.bony_nodes.iter().chain(s.rollers.iter().map(|(n, _)| n));
    if fixed.clone().next().is_none() {
        return fault(format!("solid {name} is fixed to nothing: give bony nodes or rollers"));
    }
    if let Some(n) = fixed.clone().find(|n| **n as usize >= count) {
        return fault(format!("solid {name}: fixed node {n} is not there"));
    }
    if s.body >= bodies {
        return fault(format!("solid {name}: no body {} to be fixed to", s.body));
    }
    elements(s)
}

/// Refuses thin, flat, turned-over and absurdly sized elements, by number.
fn elements(s: &Solid) -> Result<(), DeformableError> {
    let name = &s.name;
    for (e, nodes) in s.mesh.elements.iter().enumerate() {
        let p = nodes.map(|n| s.mesh.nodes[n as usize]);
        let longest = (1..8).map(|k| (p[k] - p[0]).norm()).fold(0.0, f64::max);
        if !(0.005..=100.0).contains(&longest) {
            return fault(format!(
                "solid {name}: element {e} is {longest:.3e} mm wide, expected 0.005 to 100 mm: check that lengths are in mm"
            ));
        }
        let volume = s.mesh.element_volume(e);
        if volume.abs() < 1e-6 * longest.powi(3) {
            return fault(format!("solid {name}: element {e} has no thickness (volume {volume:.3e} mm3)"));
        }
        let shape = s.mesh.scaled_jacobian(e);
        if volume < 0.0 || shape <= 0.0 {
            return fault(format!(
                "solid {name}: element {e} is inverted (volume {volume:.3e} mm3, least scaled Jacobian {shape:.3}): mend the mesh"
            ));
        }
    }
    Ok(())
}

fn points(name: &str, nodes: &[Point]) -> Result<(), DeformableError> {
    if let Some(n) = nodes.iter().position(|p| !p.coords.iter().all(|x| x.abs() < 1e5)) {
        let p = nodes[n];
        return fault(format!("{name}: node {n} lies at ({}, {}, {}), expected finite places in mm", p.x, p.y, p.z));
    }
    Ok(())
}

fn quads(name: &str, quads: &[[u32; 4]], nodes: usize) -> Result<(), DeformableError> {
    if let Some(q) = quads.iter().position(|q| q.iter().any(|&n| n as usize >= nodes)) {
        return fault(format!("{name}: quadrilateral {q} names a node that is not there"));
    }
    Ok(())
}
