//! Sites that lie otherwise than a plan asked: in sentences, and in few words for a table.

use super::file::{GraftFile, PERCENTS, PlanFile};
use super::knee::{Placed, is_acl};
use super::sites::{ACL_PERCENT, Bone};
use meshes::Point;
use notices::{Kind, Notice};
use sim::names::is_of;

/// A moved site is told of where it went this much less far than it was asked to [mm]; ours: what a drill can be aimed by.
const SHORT_MM: f64 = 1.0;

/// Strains in the CT pose that a slack length may give [-]; ours: a ligament is torn at some 0.2, and a graft that is slack by a quarter is never taut.
const STRAINS: std::ops::RangeInclusive<f64> = -0.25..=0.2;

/// Where a graft's ends lie [%]: on the femur by the quadrant method, on the tibia of the plateau.
pub(super) type Percents = [Option<[f64; 2]>; 2];

/// How a graft runs.
pub(super) struct Run {
    /// Where it leaves the femur, the mean of its lines, CT frame [mm].
    pub(super) femur_mm: [f64; 3],
    /// Length between the bones in the CT pose [mm].
    pub(super) length_mm: f64,
    /// Slack length [mm].
    pub(super) slack_mm: f64,
}

/// A site that was moved.
struct Moved {
    bone: &'static str,
    /// What its percentages are by.
    by: &'static str,
    asked_mm: f64,
    went_mm: f64,
    /// Where it lies [%], if no file could ask for that.
    beyond: Option<[f64; 2]>,
}

impl Moved {
    /// Whether it ended before it was moved as far as was asked.
    fn is_short(&self) -> bool {
        self.asked_mm - self.went_mm > SHORT_MM
    }
}

/// The sites of a graft that were moved.
fn moved(graft: &GraftFile, placed: &Placed, told: Percents) -> Vec<Moved> {
    let ends = [
        ("femur", &graft.femur, told[0], "by the quadrant method"),
        ("tibia", &graft.tibia, told[1], "of the plateau"),
    ];
    let mut out = Vec::new();
    for ((bone, site, percent, by), went_mm) in ends.into_iter().zip(placed.went_mm) {
        let asked_mm = site.move_mm.iter().map(|x| x * x).sum::<f64>().sqrt();
        if asked_mm == 0.0 {
            continue;
        }
        let is_of_acl =
            site.native.as_deref().is_some_and(is_acl) || site.quadrant_percent.or(site.plateau_percent).is_some();
        let is_off = |both: &[f64; 2]| both.iter().any(|p| !(PERCENTS[0]..=PERCENTS[1]).contains(p));
        let beyond = percent.filter(|both| is_of_acl && is_off(both));
        out.push(Moved { bone, by, asked_mm, went_mm, beyond });
    }
    out
}

/// A native site of an ACL that the quadrant method does not know: it is not on the inner wall of the lateral condyle, below the roof of the notch.
pub(super) fn laid_on_the_wall(graft: &GraftFile, placed: &Placed) -> Option<Notice> {
    let [depth, height] = placed.off_the_wall?;
    let place = if height < 0.0 { "above the roof of the notch" } else { "beyond the lateral condyle" };
    let [by_depth, by_height] = ACL_PERCENT;
    let text = format!(
        "graft {:?}: on the femur the model's own ACL has depth {depth:.0} % and height {height:.0} % by the quadrant method: {place}; expected 0 to \
         100. So the graft begins at {by_depth} and {by_height} %, where dissected ones do. Look at the marks of the femur, or give quadrant_percent",
        graft.name
    );
    Some(Kind::GivenFar.notice(text))
}

/// Sites that ended before they were moved as far as was asked, and moved sites of an ACL that no file could ask for by their percentages.
pub(super) fn moved_away(graft: &GraftFile, placed: &Placed, told: Percents) -> Vec<Notice> {
    let mut out = Vec::new();
    for one in moved(graft, placed, told) {
        let (name, bone) = (&graft.name, one.bone);
        if one.is_short() {
            out.push(Kind::GivenFar.notice(format!(
                "graft {name:?}: {bone}.move_mm asks for {:.1} mm along the bone, and the site went {:.1} mm: there the bone turns away. \
                 Look at where it lies",
                one.asked_mm, one.went_mm
            )));
        }
        if let Some([first, second]) = one.beyond {
            let ([least, most], by) = (PERCENTS, one.by);
            out.push(Kind::GivenFar.notice(format!(
                "graft {name:?}: {bone}.move_mm took its site to {first:.0} and {second:.0} % {by}; expected {least} to {most}, as for a typed site"
            )));
        }
    }
    out
}

/// A graft that runs from elsewhere than the notch's lateral wall in place of an ACL, between footprints of two ligaments, or that its slack length does not fit.
pub(super) fn astray(femur: &Bone, (file, graft): (&PlanFile, &GraftFile), run: &Run) -> Vec<Notice> {
    let name = &graft.name;
    let begins = Point::from(run.femur_mm);
    let lateral_mm = femur.lateral_mm(&begins);
    let is_by_an_acl = graft.femur.native.as_deref().is_some_and(is_acl) || graft.femur.quadrant_percent.is_some();
    let is_meant = if lateral_mm < 0.0 { is_for_the_acl(file, graft) } else { is_by_an_acl };
    let off = (is_meant && !femur.is_by_the_wall(&begins)).then(|| {
        format!(
            "graft {name:?}: on the femur it begins {:.0} mm {} of the midline; an ACL begins on the lateral wall of the notch. Look at the signs \
             of move_mm or point_mm",
            lateral_mm.abs(),
            if lateral_mm < 0.0 { "medial" } else { "lateral" }
        )
    });
    let by_percent = graft.femur.quadrant_percent.map(|_| "ACL");
    let of = [graft.femur.native.as_deref().or(by_percent), graft.tibia.native.as_deref()];
    let mixed = of[0].zip(of[1]).filter(|(a, b)| !run_together(a, b)).map(|(a, b)| {
        format!(
            "graft {name:?}: it runs from the footprint of {a} on the femur to that of {b} on the tibia; expected those of one ligament, or of \
             ligaments of one side"
        )
    });
    let strain = run.length_mm / run.slack_mm - 1.0;
    let unfit = (!STRAINS.contains(&strain)).then(|| {
        let what = if strain > 0.0 { "strained by" } else { "slack by" };
        let (apart, share) = (run.length_mm, 100.0 * strain.abs());
        match graft.slack_length_mm {
            Some(slack) => format!(
                "graft {name:?}: slack_length_mm is {slack}, and its sites lie {apart:.1} mm apart in the CT pose: it is {what} {share:.0} % there. A \
                 length in mm was expected, near that"
            ),
            None => format!(
                "graft {name:?}: fixed as asked its slack length is {:.1} mm, and its sites lie {apart:.1} mm apart in the CT pose: it is {what} \
                 {share:.0} % there. Look at its tension, at the flexion where it is fixed, and at its sites",
                run.slack_mm
            ),
        }
    });
    [off, mixed, unfit].into_iter().flatten().map(|text| Kind::GivenFar.notice(text)).collect()
}

/// Ligaments between whose footprints a graft may run: a tenodesis goes from that of the LCL to that of the ALS.
const TOGETHER: [&[&str]; 4] =
    [&["ACL"], &["PCL"], &["sMCL", "dMCL", "POL", "PCAP_M"], &["LCL", "ALS", "PFL", "PCAP_L"]];

/// Whether a graft may run between two footprints; of what nobody knows a graft may do so.
fn run_together(femur: &str, tibia: &str) -> bool {
    let group = |name: &str| TOGETHER.iter().position(|group| group.iter().any(|ligament| is_of(name, ligament)));
    group(femur).zip(group(tibia)).is_none_or(|(a, b)| a == b)
}

/// Whether a graft stands for an ACL: by a native site, or by one that counts as an ACL's where only an ACL is cut.
fn is_for_the_acl(file: &PlanFile, graft: &GraftFile) -> bool {
    let natives = [&graft.femur, &graft.tibia].map(|site| site.native.as_deref());
    let is_cut = !file.cut.is_empty() && file.cut.iter().all(|c| is_acl(c));
    match natives {
        [Some(femur), _] => is_acl(femur),
        [None, Some(tibia)] => is_acl(tibia),
        [None, None] => is_cut,
    }
}

/// The same in few words.
pub(super) fn briefly(graft: &GraftFile, placed: &Placed, told: Percents) -> Vec<String> {
    let wall = |[depth, height]: [f64; 2]| {
        let [by_depth, by_height] = ACL_PERCENT;
        format!("femur: laid at {by_depth} and {by_height} %, the knee's own ACL is at {depth:.0} and {height:.0} %")
    };
    let mut out: Vec<String> = placed.off_the_wall.map(wall).into_iter().collect();
    for one in moved(graft, placed, told) {
        if one.is_short() {
            out.push(format!("{}: went {:.1} of {:.1} mm", one.bone, one.went_mm, one.asked_mm));
        }
        out.extend(one.beyond.map(|[first, second]| format!("{}: at {first:.0} and {second:.0} %", one.bone)));
    }
    out
}

#[cfg(test)]
mod tests {
    use super::super::file::{EXAMPLE, parsed};
    use super::*;

    #[test]
    fn few_words_say_of_the_same_sites_as_the_sentences() {
        let mut graft = parsed(EXAMPLE).unwrap().graft.remove(0);
        (graft.femur.move_mm, graft.tibia.move_mm) = ([6.0, 0.0, 0.0], [0.0, 0.0, 3.0]);
        let placed =
            |went_mm: [f64; 2]| Placed { ends: vec![], stiffness: 200.0, whole: None, off_the_wall: None, went_mm };
        let told = |tibia: [f64; 2]| [Some([24.0, 28.0]), Some(tibia)];
        for (went, tibia, words) in [
            ([6.0, 3.0], [41.0, 48.0], vec![]),
            ([2.5, 2.5], [41.0, 48.0], vec!["femur: went 2.5 of 6.0 mm"]),
            ([5.5, 1.0], [41.0, 112.0], vec!["tibia: went 1.0 of 3.0 mm", "tibia: at 41 and 112 %"]),
        ] {
            let few = briefly(&graft, &placed(went), told(tibia));
            assert_eq!(few, words);
            assert_eq!(moved_away(&graft, &placed(went), told(tibia)).len(), few.len());
        }
        let off = Placed { off_the_wall: Some([18.0, -15.0]), ..placed([6.0, 3.0]) };
        assert!(briefly(&graft, &off, told([41.0, 48.0]))[0].ends_with("ACL is at 18 and -15 %"));
        assert!(laid_on_the_wall(&graft, &off).is_some() && laid_on_the_wall(&graft, &placed([6.0, 3.0])).is_none());
    }
}
