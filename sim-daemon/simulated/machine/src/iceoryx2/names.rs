//! Names of files, as iceoryx2 makes them.

use std::path::{Path, PathBuf};

use super::config::Config;
use super::hash;

/// The files of one daemon.
#[derive(Debug, Clone)]
pub(crate) struct Names {
    root: PathBuf,
    nodes: PathBuf,
    services: PathBuf,
    prefix: String,
}

/// A monitor's three files.
pub(crate) struct Monitor {
    pub(crate) state: PathBuf,
    pub(crate) owner_lock: PathBuf,
    pub(crate) context: PathBuf,
}

const MONITOR: &str = ".node_monitor";

impl Names {
    pub(crate) fn for_config(config: &Config) -> Names {
        let root = PathBuf::from(config.global.root_path().to_string());
        Names {
            nodes: PathBuf::from(config.global.node_dir().to_string()),
            services: root.join(config.global.service.directory.to_string()),
            prefix: config.global.prefix.to_string(),
            root,
        }
    }

    /// A file that begins with a number of what type it holds.
    fn typed(&self, kind: &str, name: &str) -> PathBuf {
        let hash = hash(&[kind]);
        let low = hash as u32;
        let file = format!(
            "{}{hash:016x}{hash:016x}{low:08x}_{name}.{kind}",
            self.prefix
        );
        self.root.join(file)
    }

    pub(crate) fn data(&self, port: u128) -> PathBuf {
        self.typed("data", &port.to_string())
    }

    pub(crate) fn connection(&self, sender: u128, receiver: u128) -> PathBuf {
        self.typed("connection", &format!("{sender}_{receiver}"))
    }

    /// The socket of a listener.
    pub(crate) fn event(&self, listener: u128) -> PathBuf {
        self.root.join(format!("{}{listener}.event", self.prefix))
    }

    pub(crate) fn event_state(&self, listener: u128) -> PathBuf {
        self.typed("event_mgmt", &listener.to_string())
    }

    pub(crate) fn dynamic(&self, service: u128) -> PathBuf {
        self.typed("dynamic", &service.to_string())
    }

    /// The settings of a service.
    pub(crate) fn service(&self, hash: &str) -> PathBuf {
        self.services.join(format!("{}{hash}.service", self.prefix))
    }

    pub(crate) fn services(&self) -> &Path {
        &self.services
    }

    pub(crate) fn nodes(&self) -> &Path {
        &self.nodes
    }

    pub(crate) fn node(&self, node: u128) -> PathBuf {
        self.nodes.join(node.to_string())
    }

    pub(crate) fn details(&self, node: u128) -> PathBuf {
        self.node(node).join(format!("{}node.details", self.prefix))
    }

    pub(crate) fn port_tag(&self, node: u128, port: u128) -> PathBuf {
        self.node(node)
            .join(format!("{}{port}.port_tag", self.prefix))
    }

    pub(crate) fn service_tag(&self, node: u128, hash: &str) -> PathBuf {
        self.node(node)
            .join(format!("{}{hash}.service_tag", self.prefix))
    }

    pub(crate) fn monitor(&self, node: u128) -> Monitor {
        let with = |suffix| {
            self.nodes
                .join(format!("{}{node}{MONITOR}{suffix}", self.prefix))
        };
        Monitor {
            state: with(""),
            owner_lock: with("_owner_lock"),
            context: with("_context"),
        }
    }

    /// The node whose monitor a file is.
    pub(crate) fn monitored(&self, file: &str) -> Option<u128> {
        let name = file.strip_prefix(&self.prefix)?.strip_suffix(MONITOR)?;
        name.parse().ok()
    }

    /// What a tag in the folder of a node stands for.
    pub(crate) fn tagged<'a>(&self, file: &'a str, suffix: &str) -> Option<&'a str> {
        file.strip_prefix(&self.prefix)?.strip_suffix(suffix)
    }

    /// The two ports of the file of a connection.
    pub(crate) fn connected(&self, file: &str) -> Option<(u128, u128)> {
        let name = file
            .strip_prefix(&self.prefix)?
            .strip_suffix(".connection")?;
        let mut parts = name.split('_').skip(1);
        let mut id = || parts.next()?.parse().ok();
        Some((id()?, id()?))
    }

    pub(crate) fn root(&self) -> &Path {
        &self.root
    }
}
