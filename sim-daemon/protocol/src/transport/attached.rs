//! Who is attached to a daemon, for the error when there are too many.

use std::collections::BTreeMap;

use crate::doors::iceoryx2::node::NodeView;
use crate::doors::iceoryx2::prelude::{CallbackProgression, Node, NodeState, Service};

/// Processes that a message lists.
const LISTED_MAX: usize = 8;

/// The processes that are attached beside a client's own node, those first that are so most often; ends a clause.
pub(crate) fn holders<S: Service>(client_node: &Node<S>) -> String {
    let mut clients: BTreeMap<u32, usize> = BTreeMap::new();
    let listed = Node::<S>::list(client_node.config(), |node| {
        let is_client = match &node {
            NodeState::Alive(alive) => {
                (alive.details().as_ref()).is_none_or(|details| details.name().as_str() == "client")
            }
            _ => false,
        };
        // one without a readable id belongs to nobody who could be named
        let pid = node.node_id().pid::<S>().ok();
        if let (true, Some(pid)) = (is_client && node.node_id() != client_node.id(), pid) {
            *clients.entry(pid.value() as u32).or_default() += 1;
        }
        CallbackProgression::Continue
    });
    match listed {
        Ok(()) => said(clients),
        Err(_) => String::new(),
    }
}

fn said(clients: BTreeMap<u32, usize>) -> String {
    let mut clients: Vec<_> = clients.into_iter().collect();
    clients.sort_by_key(|&(pid, count)| (std::cmp::Reverse(count), pid));
    let listed = clients.iter().take(LISTED_MAX);
    let listed = listed.map(|(pid, count)| format!("process {pid} has {count}"));
    let mut listed: Vec<String> = listed.collect();
    if clients.len() > LISTED_MAX {
        listed.push(format!(
            "{} more processes have the rest",
            clients.len() - LISTED_MAX
        ));
    }
    match listed.is_empty() {
        true => String::new(),
        false => format!(" ({})", listed.join(", ")),
    }
}

#[cfg(all(test, not(simulated)))]
mod tests {
    use super::*;

    #[test]
    fn holders_are_listed_by_how_often_they_are_attached_and_not_without_end() {
        assert_eq!(said(BTreeMap::new()), "");
        let two = said(BTreeMap::from([(7, 1), (9, 63)]));
        assert_eq!(two, " (process 9 has 63, process 7 has 1)");
        let many = said((0..64).map(|pid| (pid, 1)).collect());
        assert!(
            many.ends_with("process 7 has 1, 56 more processes have the rest)"),
            "{many}"
        );
    }
}
