//! What follows from a description: who carries whom, sums, and numbers as people write them.

use sim_model::{Joint, JointKind, Robot};

/// A robot and its links in body order.
pub(super) struct Properties<'a> {
    pub robot: &'a Robot,
    /// Links, parents before children.
    pub order: Vec<usize>,
    /// The joints above each link, as indices of `robot.joints`; several of a link of a MuJoCo model.
    pub joints_above: Vec<Vec<usize>>,
    /// Links below each link, in the order of their joints.
    pub children: Vec<Vec<usize>>,
    /// The link that each one is part of: itself if it moves, or is the root.
    pub body: Vec<usize>,
}

impl<'a> Properties<'a> {
    pub fn new(robot: &'a Robot) -> Properties<'a> {
        let order = robot.link_order();
        let mut joints_above = vec![Vec::new(); robot.links.len()];
        let mut children = vec![Vec::new(); robot.links.len()];
        for (index, joint) in robot.joints.iter().enumerate() {
            joints_above[joint.child].push(index);
            let parent = joint
                .parent
                .filter(|_| joints_above[joint.child].len() == 1);
            if let Some(parent) = parent {
                children[parent].push(joint.child);
            }
        }
        let mut body: Vec<usize> = (0..robot.links.len()).collect();
        for &link in &order {
            let first: Option<&usize> = joints_above[link].first();
            let joint = first.map(|&index| &robot.joints[index]);
            if let Some(parent) = joint.filter(|joint| !joint.moves()).and_then(|j| j.parent) {
                body[link] = body[parent];
            }
        }
        Properties {
            robot,
            order,
            joints_above,
            children,
            body,
        }
    }

    /// The joint above a link, the first of several.
    pub fn joint(&self, link: usize) -> Option<&'a Joint> {
        self.joints(link).next()
    }

    /// The joints above a link.
    pub fn joints(&self, link: usize) -> impl Iterator<Item = &'a Joint> {
        let robot = self.robot;
        let above = self.joints_above[link].iter();
        above.map(|&index| &robot.joints[index])
    }

    /// The link that a link is merged into, if it does not move by itself.
    pub fn merged_into(&self, link: usize) -> Option<&'a str> {
        (self.body[link] != link).then(|| self.robot.links[self.body[link]].name.as_str())
    }

    /// Names of the links in body order.
    pub fn names(&self) -> Vec<String> {
        let name = |&link: &usize| self.robot.links[link].name.clone();
        self.order.iter().map(name).collect()
    }

    /// Place in body order of the link above each link, in body order.
    pub fn parent_places(&self) -> Vec<Option<usize>> {
        let mut place = vec![0; self.order.len()];
        for (index, &link) in self.order.iter().enumerate() {
            place[link] = index;
        }
        let parent = |&link: &usize| self.joint(link)?.parent.map(|parent| place[parent]);
        self.order.iter().map(parent).collect()
    }

    /// Mass of all links [kg].
    pub fn mass(&self) -> f64 {
        let inertials = self.robot.links.iter().filter_map(|link| link.inertial);
        inertials.map(|inertial| inertial.mass).sum()
    }

    pub fn dofs(&self) -> usize {
        self.robot.joints.iter().map(|joint| joint.dofs.len()).sum()
    }

    pub fn coords(&self) -> usize {
        self.robot.joints.iter().map(|joint| joint.q.len()).sum()
    }

    /// Joints whose position at the start is outside their range.
    pub fn outside_range(&self) -> Vec<&'a str> {
        let moving = self.robot.moving_joints();
        let joints = moving.into_iter().map(|index| &self.robot.joints[index]);
        joints
            .filter(|joint| {
                joint
                    .range
                    .is_some_and(|[low, high]| !(low..=high).contains(&joint.q[0]))
            })
            .map(|joint| joint.name.as_str())
            .collect()
    }

    /// Links whose joint is the first that moves above them, and whether it is free.
    fn roots(&self) -> impl Iterator<Item = bool> {
        let is_root = |&&link: &&usize| {
            let moves = self.joints(link).any(Joint::moves);
            let parent = self.joint(link).and_then(|joint| joint.parent);
            moves && parent.is_none_or(|parent| self.is_fixed(parent))
        };
        let is_free = |&link: &usize| {
            let mut joints = self.joints(link);
            joints.any(|joint| joint.kind == JointKind::Free)
        };
        self.order.iter().filter(is_root).map(is_free)
    }

    /// Whether nothing moves a link.
    fn is_fixed(&self, link: usize) -> bool {
        let mut link = Some(link);
        while let Some(current) = link {
            if self.joints(current).any(Joint::moves) {
                return false;
            }
            link = self.joint(current).and_then(|joint| joint.parent);
        }
        true
    }

    /// Whether everything that moves is free, of a URDF file its root.
    pub fn is_floating(&self) -> bool {
        let all_free = || self.roots().count() > 0 && self.roots().all(|is_free| is_free);
        self.robot.floating || (self.robot.precompiled.is_some() && all_free())
    }

    /// What holds the robot.
    pub fn base(&self) -> String {
        let free = self.roots().filter(|&is_free| is_free).count();
        match (self.is_floating(), free) {
            (true, ..2) => "floating base".to_owned(),
            (true, bodies) => format!("{bodies} floating bodies"),
            (false, 0) => "fixed base".to_owned(),
            (false, 1) => "fixed base and 1 floating body".to_owned(),
            (false, bodies) => format!("fixed base and {bodies} floating bodies"),
        }
    }

    /// The robot in a line.
    pub fn in_a_line(&self) -> String {
        let shapes = self.robot.links.iter().map(|l| l.collisions.len()).sum();
        format!(
            "{}, {}, {}, {} kg, {}",
            count(self.order.len(), "link"),
            count(self.dofs(), "dof"),
            self.base(),
            short(self.mass()),
            count(shapes, "collision shape"),
        )
    }
}

/// A shape in its plural where there are several.
pub(super) fn kinds(number: usize, kind: &str) -> String {
    match (kind, number) {
        ("box" | "mesh", 2..) => format!("{number} {kind}es"),
        _ => count(number, kind),
    }
}

/// How often each word comes, in the order in which they come first.
pub(super) fn tally<'a>(words: impl Iterator<Item = &'a str>) -> Vec<(&'a str, usize)> {
    let mut tallied: Vec<(&str, usize)> = Vec::new();
    for word in words {
        match tallied.iter_mut().find(|(other, _)| *other == word) {
            Some((_, count)) => *count += 1,
            None => tallied.push((word, 1)),
        }
    }
    tallied
}

/// A number, and what it consists of.
pub(super) fn with_kinds(all: usize, kinds: impl Iterator<Item = String>) -> String {
    let kinds: Vec<String> = kinds.collect();
    match kinds.len() {
        0 => all.to_string(),
        _ => format!("{all}: {}", kinds.join(", ")),
    }
}

/// `3 links`, `1 link`.
pub(super) fn count(number: usize, what: &str) -> String {
    let end = if number == 1 { "" } else { "s" };
    format!("{number} {what}{end}")
}

/// A number to six digits, without zeros at the end.
pub(super) fn short(value: f64) -> String {
    rounded(value, 6)
}

/// A number to so many digits, without zeros at the end.
pub(super) fn rounded(value: f64, digits: usize) -> String {
    let text = format!("{value:.*e}", digits - 1);
    let Ok(value) = text.parse::<f64>() else {
        return text;
    };
    let size = value.abs();
    if value == 0.0 {
        "0".to_owned()
    } else if (1e-4..1e7).contains(&size) {
        format!("{value}")
    } else {
        format!("{value:e}")
    }
}

/// `(1, 2, 3)`, to the tenth of a millimetre or what else `step` is.
pub(super) fn triple(values: [f64; 3], step: f64) -> String {
    let parts = values.map(|value| {
        // + 0 takes the sign from −0
        let near = (value / step).round() * step + 0.0;
        if near == 0.0 && value != 0.0 && value.abs() > 1e-3 * step {
            rounded(value, 2)
        } else {
            short(near)
        }
    });
    format!("({})", parts.join(", "))
}

/// `x`, `-z`, or the vector.
pub(super) fn axis(axis: [f64; 3]) -> String {
    for (name, part) in ["x", "y", "z"].into_iter().zip(axis) {
        // what is left of a unit vector beside this part
        if part.abs() > 1.0 - 1e-9 {
            let sign = if part < 0.0 { "-" } else { "" };
            return format!("{sign}{name}");
        }
    }
    triple(axis, 1e-4)
}

/// Unit of the position of a joint with one dof.
pub(super) fn unit(kind: JointKind) -> &'static str {
    match kind {
        JointKind::Prismatic => "m",
        _ => "rad",
    }
}
