//! The design variables of a calibration: Table 3 of [andreassen2025], its order and its ranges.
//!
//! X1 to X14 are reference strains [-], X15 to X26 stiffnesses [N/mm]; X18 is shared by the three fibres of the superficial MCL.

use crate::error::CalibrationError;
use attachments::bundle::{BUNDLES, Range};
use inference::knee::Quantity;
use serde::{Deserialize, Serialize};
use sim::spec::{BundleSpec, ModelSpec};
use std::collections::BTreeMap;
use std::sync::LazyLock;

/// Which number of a bundle a variable is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// Ratio of length to slack length in the CT pose [-].
    ReferenceStrain,
    /// Of the whole bundle [N/mm].
    StiffnessNPerMm,
}

impl Kind {
    /// The name in files.
    pub fn name(self) -> &'static str {
        match self {
            Kind::ReferenceStrain => "reference_strain",
            Kind::StiffnessNPerMm => "stiffness_n_per_mm",
        }
    }
}

/// A design variable.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Variable {
    /// The n of X_n.
    pub number: u32,
    /// Reference strain or stiffness.
    pub kind: Kind,
    /// The bundles that share it.
    pub bundles: Vec<String>,
    /// Smallest value [- or N/mm].
    pub lower: f64,
    /// Largest value [- or N/mm].
    pub upper: f64,
}

impl Variable {
    /// What of a knee it is; `bundles` are the names of the model's.
    pub fn quantity(&self, bundles: &[String]) -> Quantity {
        let own = self.bundles.iter().filter_map(|b| bundles.iter().position(|name| name == b)).collect();
        match self.kind {
            Kind::ReferenceStrain => Quantity::ReferenceStrain(own),
            Kind::StiffnessNPerMm => Quantity::Stiffness(own),
        }
    }

    /// The bundle's name, or the ligament's where several bundles share the variable (Table 4 says sMCL).
    pub fn bundle(&self) -> String {
        match self.bundles.as_slice() {
            [one] => one.clone(),
            several => several.first().map_or(String::new(), |b| b.split('_').next().unwrap_or(b).to_owned()),
        }
    }

    /// Width of the range.
    pub fn width(&self) -> f64 {
        self.upper - self.lower
    }
}

/// The design variables, ascending by number.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Design {
    /// The variables.
    pub variables: Vec<Variable>,
}

/// Table 3, by the numbers of its variables.
static TABLE_3: LazyLock<Design> = LazyLock::new(|| {
    let mut by_number: BTreeMap<u32, Variable> = BTreeMap::new();
    for row in BUNDLES.iter() {
        let ranges = [(Kind::ReferenceStrain, &row.reference_strain), (Kind::StiffnessNPerMm, &row.stiffness_n_per_mm)];
        for (kind, &Range { variable: number, lower, upper }) in ranges {
            let fresh = || Variable { number, kind, bundles: vec![], lower, upper };
            by_number.entry(number).or_insert_with(fresh).bundles.push(row.name.clone());
        }
    }
    Design { variables: by_number.into_values().collect() }
});

impl Design {
    /// The 26 variables of Table 3.
    pub fn table3() -> Design {
        TABLE_3.clone()
    }

    /// Table 3's variables of the bundles this model has.
    ///
    /// # Errors
    /// No bundle of the model bears a name of Table 3.
    pub fn of_model(spec: &ModelSpec) -> Result<Design, CalibrationError> {
        let has = |name: &String| spec.bundles.iter().any(|b| b.name == *name);
        let mut design = Design::table3();
        for v in &mut design.variables {
            v.bundles.retain(has);
        }
        design.variables.retain(|v| !v.bundles.is_empty());
        if design.variables.is_empty() {
            let names: Vec<&str> = spec.bundles.iter().map(|b| b.name.as_str()).collect();
            return Err(CalibrationError::Model(format!(
                "no bundle has a name of Table 3 (ACL_AM, ACL_PL, LCL, ...); its bundles are: {}",
                names.join(", ")
            )));
        }
        Ok(design)
    }

    /// Number of variables.
    pub fn len(&self) -> usize {
        self.variables.len()
    }

    /// True without variables.
    pub fn is_empty(&self) -> bool {
        self.variables.is_empty()
    }

    /// The variables' values in a model; of a shared variable the mean over its bundles, of a frame's 0.
    pub fn values(&self, spec: &ModelSpec) -> Vec<f64> {
        let mean = |v: &Variable| {
            let of = |b: &BundleSpec| match v.kind {
                Kind::ReferenceStrain => b.reference_strain,
                _ => b.stiffness_n_per_mm,
            };
            let all: Vec<f64> = spec.bundles.iter().filter(|b| v.bundles.contains(&b.name)).map(of).collect();
            all.iter().sum::<f64>() / all.len() as f64
        };
        self.variables.iter().map(mean).collect()
    }

    /// The model with these values.
    pub fn apply(&self, spec: &ModelSpec, values: &[f64]) -> ModelSpec {
        let mut out = spec.clone();
        for (v, &x) in self.variables.iter().zip(values) {
            for b in out.bundles.iter_mut().filter(|b| v.bundles.contains(&b.name)) {
                match v.kind {
                    Kind::ReferenceStrain => b.reference_strain = x,
                    _ => b.stiffness_n_per_mm = x,
                }
            }
        }
        out
    }

    /// The same, but variables that bundles of a model share without being alike are split: each bundle keeps its own value.
    #[must_use]
    pub fn separated(mut self, spec: &ModelSpec) -> Design {
        let mut variables = Vec::new();
        for v in self.variables {
            let own = Design {
                variables: v.bundles.iter().map(|b| Variable { bundles: vec![b.clone()], ..v.clone() }).collect(),
            };
            let values = own.values(spec);
            let is_alike = values.iter().all(|x| (x - values[0]).abs() <= 1e-12 * values[0].abs());
            if is_alike { variables.push(v) } else { variables.extend(own.variables) }
        }
        self.variables = variables;
        self
    }

    /// The same variables with ranges widened to hold these points (the hull of Table 3 and of published values).
    #[must_use]
    pub fn widened(&self, points: &[Vec<f64>]) -> Design {
        let mut out = self.clone();
        for point in points {
            for (v, &x) in out.variables.iter_mut().zip(point) {
                v.lower = v.lower.min(x);
                v.upper = v.upper.max(x);
            }
        }
        out
    }

    /// The same variables with other ranges, by name "X7" or "LCL.reference_strain".
    ///
    /// # Errors
    /// A name of no variable, a range that is empty or not finite, a reference strain below 0.05 or a stiffness below 0.
    pub fn with_ranges(&self, ranges: &BTreeMap<String, [f64; 2]>) -> Result<Design, CalibrationError> {
        let mut out = self.clone();
        for (name, &[lower, upper]) in ranges {
            let named = |v: &Variable| *name == format!("X{}", v.number) || *name == v.name();
            let Some(v) = out.variables.iter_mut().find(|v| named(v)) else {
                return Err(CalibrationError::Option(format!(
                    "ranges.{name}: no such design variable; expected X1 to X26 or a name such as LCL.reference_strain"
                )));
            };
            let least = match v.kind {
                Kind::ReferenceStrain => 0.05,
                Kind::StiffnessNPerMm => 0.0,
            };
            if !(lower.is_finite() && upper.is_finite() && lower >= least && lower < upper) {
                return Err(CalibrationError::Option(format!(
                    "ranges.{name}: [{lower}, {upper}], expected {least} <= lower < upper"
                )));
            }
            (v.lower, v.upper) = (lower, upper);
        }
        Ok(out)
    }

    /// A point of the box from coordinates 0 to 1.
    pub fn at(&self, unit: &[f64]) -> Vec<f64> {
        self.variables.iter().zip(unit).map(|(v, u)| (v.lower + u * v.width()).clamp(v.lower, v.upper)).collect()
    }

    /// Coordinates 0 to 1 of a point, clamped into the box.
    pub fn unit(&self, values: &[f64]) -> Vec<f64> {
        self.variables.iter().zip(values).map(|(v, x)| ((x - v.lower) / v.width()).clamp(0.0, 1.0)).collect()
    }
}

impl Variable {
    /// Bundle and kind in one word: `LCL.reference_strain`.
    pub fn name(&self) -> String {
        format!("{}.{}", self.bundle(), self.kind.name())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn table_3_has_its_26_variables_in_order() {
        let d = Design::table3();
        assert_eq!(d.variables.iter().map(|v| v.number).collect::<Vec<_>>(), (1..=26).collect::<Vec<_>>());
        let names: Vec<String> = d.variables.iter().map(Variable::name).collect();
        assert_eq!(names[0], "ACL_AM.reference_strain");
        assert_eq!(names[17], "sMCL.stiffness_n_per_mm");
        assert_eq!(d.variables[17].bundles, ["sMCL_A", "sMCL_M", "sMCL_P"]);
        assert_eq!((d.variables[25].lower, d.variables[25].upper), (50.0, 100.0));
        assert!(d.variables[..14].iter().all(|v| v.kind == Kind::ReferenceStrain));
        assert!(d.variables[14..].iter().all(|v| v.kind == Kind::StiffnessNPerMm));
    }

    #[test]
    fn unit_coordinates_come_back_and_ranges_are_checked() {
        let d = Design::table3();
        let u: Vec<f64> = (0..26).map(|i| f64::from(i) / 25.0).collect();
        let back = d.unit(&d.at(&u));
        assert!(u.iter().zip(&back).all(|(a, b)| (a - b).abs() < 1e-12));
        let ranges = |name: &str, r: [f64; 2]| d.with_ranges(&BTreeMap::from([(name.to_owned(), r)]));
        assert_eq!(ranges("X3", [0.8, 1.0]).unwrap().variables[2].lower, 0.8);
        assert_eq!(ranges("LCL.stiffness_n_per_mm", [70.0, 80.0]).unwrap().variables[16].upper, 80.0);
        assert!(ranges("X27", [0.8, 1.0]).unwrap_err().to_string().contains("X27"));
        assert!(ranges("X3", [1.0, 0.8]).is_err());
        let wide = d.widened(&[vec![2.0; 26]]);
        assert_eq!((wide.variables[0].upper, wide.variables[20].lower), (2.0, 2.0));
    }
}
