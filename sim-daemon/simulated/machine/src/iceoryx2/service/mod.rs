//! Services.

use std::fmt::Debug;

use ::iceoryx2::prelude::CallbackProgression;
pub use ::iceoryx2::service::ServiceListError;

use super::config::Config;
use super::identifiers::UniqueServiceId;
use super::names::Names;
use crate::world::{system_call, with};

pub mod builder;
pub mod port_factory;

/// A kind of service.
pub trait Service: Debug + Clone + Send + Sync + 'static {
    /// Calls with every service whose settings can be read.
    ///
    /// # Errors
    /// The folder cannot be listed.
    fn list(
        config: &Config,
        mut callback: impl FnMut(ServiceDetails) -> CallbackProgression,
    ) -> Result<(), ServiceListError> {
        let names = Names::for_config(config);
        system_call("lists the services").map_err(|_| ServiceListError::InternalError)?;
        let files = with(|world| world.files.names(names.services()));
        for hash in files
            .iter()
            .filter_map(|file| names.tagged(file, ".service"))
        {
            if system_call("reads the settings of a service").is_err() {
                continue;
            }
            let Ok(Some((id, _))) = with(|world| world.look(&names.service(hash))) else {
                continue;
            };
            let service_hash = hash.to_owned();
            let static_details = StaticConfig { service_hash, id };
            if callback(ServiceDetails { static_details }) == CallbackProgression::Stop {
                break;
            }
        }
        Ok(())
    }
}

/// What can be seen of a service.
#[derive(Debug, Clone)]
pub struct ServiceDetails {
    /// Its settings.
    pub static_details: StaticConfig,
}

/// What never changes of a service.
#[derive(Debug, Clone)]
pub struct StaticConfig {
    service_hash: String,
    id: u128,
}

impl StaticConfig {
    /// What its name and its kind make, in the names of its files.
    pub fn service_hash(&self) -> &str {
        &self.service_hash
    }

    /// Its number.
    pub fn unique_service_id(&self) -> UniqueServiceId {
        UniqueServiceId(self.id)
    }
}
