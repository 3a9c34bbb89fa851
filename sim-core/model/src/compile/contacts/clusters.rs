//! Bodies whose contacts share the columns of a Jacobian.

use sim_physics::constants::{Body, Constants};

/// Bodies of a tree that almost the same dofs move.
pub(super) struct Cluster {
    /// Their tree.
    pub tree: usize,
    /// The bodies.
    pub bodies: Vec<usize>,
    /// The dofs that move any of them, rising.
    pub dofs: Vec<usize>,
}

/// Most zero columns in a contact's Jacobian, such as those of the other finger. A lower limit makes more classes, a higher
/// one longer rows.
const IDLE_COLUMNS_MAX: usize = 2;

/// Gathers bodies into clusters, those with the longest paths first.
pub(super) fn clusters(
    constants: &Constants<f64>,
    bodies: impl Iterator<Item = usize>,
) -> Vec<Cluster> {
    let mut paths: Vec<(usize, Vec<usize>)> = Vec::new();
    for body in bodies {
        if paths.iter().all(|(known, _)| *known != body) {
            paths.push((body, path(&constants.bodies, body)));
        }
    }
    paths.sort_by_key(|(body, path)| (usize::MAX - path.len(), *body));
    let mut clusters: Vec<Cluster> = Vec::new();
    for (body, path) in &paths {
        let tree = constants.bodies[*body].tree;
        let joins = |cluster: &&mut Cluster| {
            let more = path.iter().filter(|dof| !cluster.dofs.contains(dof));
            let width = cluster.dofs.len() + more.count();
            let mut members = cluster.bodies.iter().chain([body]);
            let length = |body: &usize| {
                let (_, path) = paths
                    .iter()
                    .find(|(known, _)| known == body)
                    .expect("paths of all bodies are known");
                path.len()
            };
            cluster.tree == tree && members.all(|body| width - length(body) <= IDLE_COLUMNS_MAX)
        };
        match clusters.iter_mut().find(joins) {
            Some(cluster) => {
                cluster.bodies.push(*body);
                cluster.dofs.extend(path);
                cluster.dofs.sort_unstable();
                cluster.dofs.dedup();
            }
            None => clusters.push(Cluster {
                tree,
                bodies: vec![*body],
                dofs: path.clone(),
            }),
        }
    }
    clusters
}

/// The dofs that move a body, rising.
pub(in crate::compile) fn path(bodies: &[Body<f64>], body: usize) -> Vec<usize> {
    let mut dofs = Vec::new();
    let mut next = Some(body);
    while let Some(b) = next {
        dofs.extend(bodies[b].dofs());
        next = bodies[b].parent;
    }
    dofs.sort_unstable();
    dofs
}
