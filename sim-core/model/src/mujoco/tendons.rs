//! Tendons of a model: sums of joint positions, and lines from site to site around shapes.

use super::format::ModelFile;
use super::frames::on_links;
use super::names::names;
use crate::description::{Length, OnLink, Robot, Span, SpatialTendon, TendonPart, Wrap};
use crate::error::ModelError;

/// Smallest radius and smallest divisor of MuJoCo (`mjMINVAL`) [m, –].
const TINY: f64 = 1e-15;

/// Tendons, and what their lengths are.
pub(super) struct Tendons {
    /// Their names.
    pub names: Vec<String>,
    /// All of them.
    pub all: Vec<TendonPart>,
    /// The spatial ones that are used.
    pub spatial: Vec<SpatialTendon>,
}

impl Tendons {
    /// Reads the tendons of a model. `robot` has its joints.
    pub fn read(file: &ModelFile, robot: &Robot) -> Result<Tendons, ModelError> {
        let count = file.rows("tendon_num");
        let paths = Paths::read(file, robot)?;
        let mut tendons = Tendons {
            names: names(file, "tendon", count)?,
            all: Vec::new(),
            spatial: Vec::new(),
        };
        let (is_spatial, is_used) = (spatial_tendons(file)?, used(file, count)?);
        for k in 0..count {
            let part = if is_spatial[k] {
                let spans = paths.spans(k);
                let spans = spans.ok_or_else(|| tendons.fault(file, k))?;
                let tendon = SpatialTendon { spans };
                match is_used[k] {
                    true => {
                        tendons.spatial.push(tendon);
                        TendonPart::Used(Length::Spatial(tendons.spatial.len() - 1))
                    }
                    false => TendonPart::Idle(tendon),
                }
            } else {
                let terms = paths.joints(k);
                TendonPart::Used(Length::Joints(terms.ok_or_else(|| tendons.fault(file, k))?))
            };
            tendons.all.push(part);
        }
        Ok(tendons)
    }

    fn fault(&self, file: &ModelFile, tendon: usize) -> ModelError {
        let name = &self.names[tendon];
        file.fault(format!("has no whole path for tendon `{name}`"))
    }

    /// The length of a tendon.
    ///
    /// # Errors
    /// No such tendon.
    pub fn length(&self, file: &ModelFile, tendon: i64) -> Result<&Length, ModelError> {
        let place = usize::try_from(tendon).ok();
        match place.and_then(|place| self.all.get(place)) {
            Some(TendonPart::Used(length)) => Ok(length),
            _ => Err(file.fault(format!("has no tendon {tendon}"))),
        }
    }
}

/// Arrays of the paths of tendons.
struct Paths<'a> {
    robot: &'a Robot,
    firsts: Vec<i64>,
    counts: Vec<i64>,
    kinds: Vec<String>,
    objects: Vec<i64>,
    numbers: Vec<f64>,
    /// Places of MuJoCo's joints among the robot's.
    joints: Vec<usize>,
    sites: Vec<OnLink>,
    geoms: Vec<OnLink>,
    sizes: Vec<[f64; 3]>,
}

impl<'a> Paths<'a> {
    fn read(file: &ModelFile, robot: &'a Robot) -> Result<Paths<'a>, ModelError> {
        let (count, wraps) = (file.rows("tendon_num"), file.rows("wrap_type"));
        let links = robot.links.len();
        Ok(Paths {
            robot,
            firsts: file.integers("tendon_adr", count)?,
            counts: file.integers("tendon_num", count)?,
            kinds: file.kinds("wrap_type", wraps)?,
            objects: file.integers("wrap_objid", wraps)?,
            numbers: file.reals("wrap_prm", wraps)?,
            joints: moving(robot, file.rows("jnt_type"), file)?,
            sites: on_links(file, "site", links)?,
            geoms: on_links(file, "geom", links)?,
            sizes: file.vectors::<3>("geom_size", file.rows("geom_bodyid"))?,
        })
    }

    /// Rows of a tendon's path; none if the file has fewer.
    fn rows(&self, tendon: usize) -> Option<std::ops::Range<usize>> {
        let first = usize::try_from(self.firsts[tendon]).ok()?;
        let end = first.checked_add(usize::try_from(self.counts[tendon]).ok()?)?;
        (end <= self.kinds.len()).then_some(first..end)
    }

    fn object<T: Copy>(&self, all: &[T], row: usize) -> Option<T> {
        all.get(usize::try_from(self.objects[row]).ok()?).copied()
    }

    /// Joints of a fixed tendon and their coefficients.
    fn joints(&self, tendon: usize) -> Option<Vec<(usize, f64)>> {
        let mut terms: Vec<(usize, f64)> = Vec::new();
        for row in self.rows(tendon)? {
            let place = self.object(&self.joints, row)?;
            if self.robot.joints[place].dofs.len() != 1 {
                return None;
            }
            match terms.iter_mut().find(|(known, _)| *known == place) {
                Some((_, sum)) => *sum += self.numbers[row],
                None => terms.push((place, self.numbers[row])),
            }
        }
        Some(terms)
    }

    /// Pieces of a spatial tendon; none where MuJoCo would refuse the path.
    fn spans(&self, tendon: usize) -> Option<Vec<Span>> {
        let mut spans = Vec::new();
        let (mut from, mut share, mut wrap) = (None, 1.0, None);
        let mut is_open = false;
        for row in self.rows(tendon)? {
            match self.kinds[row].as_str() {
                // a new branch, of which a part counts
                "mjWRAP_PULLEY" if wrap.is_none() => {
                    let divisor = self.numbers[row];
                    share = (divisor >= TINY && divisor.is_finite()).then(|| 1.0 / divisor)?;
                    (from, is_open) = (None, true);
                }
                "mjWRAP_SITE" => {
                    let to = self.object(&self.sites, row)?;
                    let wrap = wrap.take().flatten();
                    spans.extend(from.map(|from| Span {
                        from,
                        to,
                        share,
                        wrap,
                    }));
                    (from, is_open) = (Some(to), false);
                }
                kind @ ("mjWRAP_SPHERE" | "mjWRAP_CYLINDER")
                    if from.is_some() && wrap.is_none() =>
                {
                    wrap = Some(self.wrap(row, kind == "mjWRAP_CYLINDER")?);
                }
                _ => return None,
            }
        }
        (wrap.is_none() && !is_open).then_some(spans)
    }

    /// A shape of a path; none of one that is too small.
    fn wrap(&self, row: usize, is_cylinder: bool) -> Option<Option<Wrap>> {
        let side = self.numbers[row];
        let side = match side > -0.5 {
            true => Some(*self.sites.get(side.round() as usize)?),
            false => None,
        };
        let [radius, ..] = self.object(&self.sizes, row)?;
        let at = self.object(&self.geoms, row)?;
        if !radius.is_finite() {
            return None;
        }
        Some((radius >= TINY).then_some(Wrap {
            at,
            is_cylinder,
            radius,
            side,
        }))
    }
}

/// Which tendons are made of other things than joints.
pub(super) fn spatial_tendons(file: &ModelFile) -> Result<Vec<bool>, ModelError> {
    let count = file.rows("tendon_num");
    let firsts = file.integers("tendon_adr", count)?;
    let counts = file.integers("tendon_num", count)?;
    let kinds = file.kinds("wrap_type", file.rows("wrap_type"))?;
    let spatial = firsts.into_iter().zip(counts).map(|(first, count)| {
        let end = first.saturating_add(count).max(0) as usize;
        let wraps = kinds.get(first.max(0) as usize..end).unwrap_or_default();
        wraps.iter().any(|kind| kind != "mjWRAP_JOINT")
    });
    Ok(spatial.collect())
}

/// Which tendons are measured, or act.
pub(super) fn used(file: &ModelFile, count: usize) -> Result<Vec<bool>, ModelError> {
    let mut used = vec![false; count];
    let arrays = [
        "tendon_damping",
        "tendon_stiffness",
        "tendon_frictionloss",
        "tendon_armature",
    ];
    for array in arrays.into_iter().filter(|array| file.has(array)) {
        let values = file.reals(array, count)?;
        (used.iter_mut().zip(values)).for_each(|(used, value)| *used |= value != 0.0);
    }
    for array in ["tendon_stiffnesspoly", "tendon_dampingpoly"] {
        let curves = file.curves(array, count, false)?;
        (used.iter_mut().zip(curves)).for_each(|(used, curve)| *used |= curve != [0.0; 2]);
    }
    let limited = file.integers("tendon_limited", count)?;
    (used.iter_mut().zip(limited)).for_each(|(used, limited)| *used |= limited != 0);
    // what names a tendon: arrays of kinds, of indices, and the kind that counts
    let mut named = |kinds: Vec<String>, ids: Vec<i64>, kind: &str| {
        for (own_kind, id) in kinds.iter().zip(ids) {
            let tendon = usize::try_from(id).ok().and_then(|id| used.get_mut(id));
            if let (true, Some(used)) = (own_kind == kind, tendon) {
                *used = true;
            }
        }
    };
    let actuators = file.rows("actuator_trntype");
    let targets = file.vectors_of_integers::<2>("actuator_trnid", actuators)?;
    let targets = targets.into_iter().map(|[target, _]| target).collect();
    let kinds = file.kinds("actuator_trntype", actuators)?;
    named(kinds, targets, "mjTRN_TENDON");
    let equalities = file.rows("eq_type");
    for array in ["eq_obj1id", "eq_obj2id"] {
        let kinds = file.kinds("eq_type", equalities)?;
        named(kinds, file.integers(array, equalities)?, "mjEQ_TENDON");
    }
    // files of older releases have none
    if !file.has("sensor_type") {
        return Ok(used);
    }
    let sensors = file.rows("sensor_type");
    let kinds = file.kinds("sensor_objtype", sensors)?;
    named(
        kinds,
        file.integers("sensor_objid", sensors)?,
        "mjOBJ_TENDON",
    );
    Ok(used)
}

/// Places of a tendon's actuators, and the range of the sum of their forces [N or N·m].
type Bound = (Vec<usize>, [f64; 2]);

/// Bounds of the sum of actuator forces along a tendon.
pub(super) fn bounds(file: &ModelFile) -> Result<Vec<Bound>, ModelError> {
    let (count, actuators) = (file.rows("tendon_num"), file.rows("actuator_trntype"));
    if file.first_set("tendon_actfrclimited").is_none() {
        return Ok(Vec::new());
    }
    let limited = file.integers("tendon_actfrclimited", count)?;
    let ranges = file.vectors::<2>("tendon_actfrcrange", count)?;
    let kinds = file.kinds("actuator_trntype", actuators)?;
    let targets = file.vectors_of_integers::<2>("actuator_trnid", actuators)?;
    let actuators_of = |tendon: usize| {
        let is_own = |&k: &usize| kinds[k] == "mjTRN_TENDON" && targets[k][0] == tendon as i64;
        (0..actuators).filter(is_own).collect::<Vec<usize>>()
    };
    let limited = (0..count).filter(|&tendon| limited[tendon] != 0);
    let bounds = limited.map(|tendon| (actuators_of(tendon), ranges[tendon]));
    Ok(bounds.filter(|(acting, _)| !acting.is_empty()).collect())
}

/// Where MuJoCo's joints are among the robot's.
pub(super) fn moving(
    robot: &Robot,
    joints: usize,
    file: &ModelFile,
) -> Result<Vec<usize>, ModelError> {
    let moving: Vec<usize> = (0..robot.joints.len())
        .filter(|&joint| robot.joints[joint].moves())
        .collect();
    match moving.len() == joints {
        true => Ok(moving),
        false => Err(file.fault("has joints without bodies".to_owned())),
    }
}
