//! Mimic joints that an array gives other values than their leaders: the constraint, or two drives, work against each other.

use sim_protocol::{Command, Description};

use crate::rows::{number, worlds};

/// Distance of a target from the leader's that is reported [rad or m].
const TARGET: f64 = 1e-3;
/// Distance of a written position that is reported [rad or m]: under load, a joint leaves its leader by less.
const POSITION: f64 = 0.02;

/// A mimic joint, by its places among dofs and coordinates.
struct Follower {
    dofs: [usize; 2],
    coords: [usize; 2],
    multiplier: f64,
    offset: f64,
    /// Drives of both follow positions.
    is_driven: bool,
}

/// The mimic joints of a simulation.
pub(crate) struct Followers(Vec<Follower>);

impl Followers {
    pub(crate) fn new(description: &Description) -> Followers {
        let place = |names: &[String], name: &String| names.iter().position(|other| other == name);
        let drives = |dof: usize| {
            description
                .driven
                .get(dof)
                .is_some_and(|flags| flags & 1 != 0)
        };
        let places = description.followers.iter().filter_map(|follower| {
            let indices = |names: &[String]| {
                Some([
                    place(names, &follower.name)?,
                    place(names, &follower.leader)?,
                ])
            };
            let dofs = indices(&description.dof_names)?;
            Some(Follower {
                dofs,
                coords: indices(&description.coord_names)?,
                multiplier: follower.multiplier,
                offset: follower.offset,
                is_driven: dofs.into_iter().all(drives),
            })
        });
        Followers(places.collect())
    }

    /// Whether a dof follows another one.
    pub(crate) fn has(&self, dof: usize) -> bool {
        self.0.iter().any(|follower| follower.dofs[0] == dof)
    }

    /// What is wrong with an array of `joint_q` or `joint_target_q`, with the cure.
    pub(crate) fn problem(
        &self,
        of: &Command<'_>,
        mask: Option<&[bool]>,
        description: &Description,
    ) -> Option<String> {
        let is_target = of.field == "joint_target_q";
        self.0.iter().find_map(|follower| {
            let [place, leader] = if is_target { follower.dofs } else { follower.coords };
            let is_given = of.columns.contains(&place) && of.columns.contains(&leader);
            if !is_given || (is_target && !follower.is_driven) {
                return None;
            }
            let slack = if is_target { TARGET } else { POSITION };
            let width = of.columns.len();
            worlds(of, mask).find_map(|world| {
                let value = |at| number(&of.values, world * width + at - of.columns.start);
                let (here, there) = (
                    value(place),
                    follower.offset + follower.multiplier * value(leader),
                );
                let names = &description.dof_names;
                ((here - there).abs() > slack).then(|| {
                    let (name, field) = (&names[follower.dofs[0]], of.field);
                    let leader = &names[follower.dofs[1]];
                    let reason = match is_target {
                        true => "their drives work against each other",
                        false => "the constraint pulls at both",
                    };
                    format!(
                        "{field} of `{name}` is {here:.4} in world {world}, and its leader `{leader}` puts it at {there:.4}, so \
                         {reason}: give the leader alone, {field}={{\"{leader}\": …}}, or both values that agree"
                    )
                })
            })
        })
    }
}
