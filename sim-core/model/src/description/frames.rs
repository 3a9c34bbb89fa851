//! Frames of a scene by their names: those of links and bodies, and sites.

use super::scene::Description;
use crate::error::{ModelError, first_few};
use crate::pose::Pose;

/// What carries a frame: the world, or a link, by the numbers of its robot and of the link in it.
pub(crate) type Bearer = Option<(usize, usize)>;

impl Description {
    /// The link of a name, `body` or `robot/link`.
    pub(crate) fn bearer(&self, what: &str, body: Option<&str>) -> Result<Bearer, ModelError> {
        let Some(body) = body else { return Ok(None) };
        let names = self.robots.iter().enumerate().flat_map(|(r, robot)| {
            robot.links.iter().enumerate().map(move |(l, link)| {
                let name = match robot.is_body() {
                    true => robot.name.clone(),
                    false => format!("{}/{}", robot.name, link.name),
                };
                (name, (r, l))
            })
        });
        let names: Vec<_> = names.collect();
        match names.iter().find(|(name, _)| name == body) {
            Some((_, link)) => Ok(Some(*link)),
            None => Err(ModelError::UnknownName {
                owner: what.to_owned(),
                what: "body or link",
                name: body.to_owned(),
                known: first_few(&names.into_iter().map(|(name, _)| name).collect::<Vec<_>>()),
            }),
        }
    }

    /// What carries a frame that is named by a site, body or link, and how it lies there.
    pub(crate) fn frame(
        &self,
        what: &str,
        frame: Option<&str>,
    ) -> Result<(Bearer, Pose), ModelError> {
        let site = self
            .sites
            .iter()
            .find(|site| Some(site.name.as_str()) == frame);
        match site {
            Some(site) => Ok((self.bearer(what, site.body.as_deref())?, site.pose)),
            None => Ok((self.bearer(what, frame)?, Pose::identity())),
        }
    }
}
