//! Nodes, services and files: who dies, who is kept out, and what is left.

use super::*;

#[test]
fn limits_of_nodes_and_ports_hold_for_the_dead_until_they_are_cleaned_up() {
    check(|| {
        let node = node();
        let service = create(&node, 1, 1, 0);
        let pids: Vec<u32> = (0..2)
            .map(|_| {
                in_process(|| {
                    let node = self::node();
                    let service = open(&node).unwrap();
                    let port = subscriber(&service);
                    (node, service, port)
                })
            })
            .collect();
        let full = service.subscriber_builder().create();
        assert_eq!(
            full.unwrap_err(),
            SubscriberCreateError::ExceedsMaxSupportedSubscribers
        );
        let fourth = self::node();
        let opened = open(&fourth).map(drop);
        assert_eq!(
            opened.unwrap_err(),
            PublishSubscribeOpenError::ExceedsMaxNumberOfNodes
        );
        pids.iter().for_each(|pid| process::kill(*pid));
        assert_eq!(service.dynamic_config().number_of_subscribers(), 2);
        assert!(open(&fourth).is_err());
        let publisher = publisher(&service);
        assert_eq!(send(&publisher, 1), 2);
        assert_eq!(clean(), 2);
        assert_eq!(service.dynamic_config().number_of_subscribers(), 0);
        assert_eq!(send(&publisher, 2), 0);
        let service = open(&fourth).unwrap();
        assert_eq!(service.dynamic_config().number_of_publishers(), 1);
        drop(subscriber(&service));
    });
}

#[test]
fn a_service_goes_with_the_last_node_that_has_it_open() {
    check(|| {
        let (first, second) = (node(), node());
        assert_eq!(
            open(&second).map(drop).unwrap_err(),
            PublishSubscribeOpenError::DoesNotExist
        );
        let created = create(&first, 1, 1, 0);
        let opened = open(&second).unwrap();
        let port = subscriber(&created);
        drop(created);
        drop(port);
        drop(first);
        let again = open(&second).unwrap();
        drop(opened);
        assert!(open(&second).is_ok());
        drop(again);
        assert_eq!(
            open(&second).map(drop).unwrap_err(),
            PublishSubscribeOpenError::DoesNotExist
        );
        let wrong = || {
            second
                .service_builder(&name("samples"))
                .publish_subscribe::<[u8]>()
                .user_header::<u64>()
        };
        let created = create(&second, 1, 1, 0);
        assert_eq!(
            wrong().open().map(drop).unwrap_err(),
            PublishSubscribeOpenError::IncompatibleTypes
        );
        drop(created);
        drop(second);
        assert_eq!(files(), [""; 0]);
    });
}

#[test]
fn of_two_who_clean_up_one_does() {
    check(|| {
        let pid = in_process(|| {
            let node = node();
            let service = create(&node, 1, 1, 0);
            let port = publisher(&service);
            (node, service, port)
        });
        process::kill(pid);
        let (done, refused) = (Arc::new(AtomicUsize::new(0)), Arc::new(AtomicUsize::new(0)));
        let cleaner = || {
            let (done, refused) = (Arc::clone(&done), Arc::clone(&refused));
            move || {
                let _ = Node::<S>::list(&config(), |node| {
                    let NodeState::Dead(dead) = node else {
                        return CallbackProgression::Continue;
                    };
                    match dead.try_remove_stale_resources() {
                        Ok(()) => done.fetch_add(1, Ordering::Relaxed),
                        Err(
                            NodeCleanupFailure::AnotherInstanceIsCleaningUpTheNode
                            | NodeCleanupFailure::ResourcesAlreadyCleanedUp,
                        ) => refused.fetch_add(1, Ordering::Relaxed),
                        Err(error) => panic!("{error:?}"),
                    };
                    CallbackProgression::Continue
                });
            }
        };
        process::spawn(cleaner());
        let threads = [cleaner(), cleaner()].map(|clean| thread::Builder::new().spawn(clean));
        for thread in threads {
            thread.unwrap().join().unwrap();
        }
        thread::sleep(Duration::from_millis(50));
        assert_eq!(done.load(Ordering::Relaxed), 1);
        assert_eq!(files(), [""; 0]);
    });
}

#[test]
fn whenever_a_client_dies_its_place_comes_back() {
    check(|| {
        let node = node();
        let service = create(&node, 1, 1, 0);
        let publisher = publisher(&service);
        for value in 0..4 {
            let pid = process::spawn(|| {
                let node = self::node();
                if let Ok(service) = open(&node) {
                    let port = service.subscriber_builder().create();
                    for _ in 0..3 {
                        let _sample = port.as_ref().ok().map(|port| port.receive().unwrap());
                        thread::sleep(Duration::from_micros(50));
                    }
                }
            });
            let life = sim_machine::random() % 100_000;
            for _ in 0..4 {
                send(&publisher, value);
                thread::sleep(Duration::from_nanos(life / 4));
            }
            process::kill(pid);
            // with a cleaner that dies as well
            let cleaner = process::spawn(|| {
                clean();
            });
            thread::sleep(Duration::from_nanos(sim_machine::random() % 100_000));
            process::kill(cleaner);
            clean();
            publisher.update_connections().unwrap();
            assert_eq!(service.dynamic_config().number_of_subscribers(), 0);
        }
        let receiver = subscriber(&service);
        send(&publisher, 9);
        assert_eq!(values(&receiver), [9]);
        drop((receiver, publisher, service));
        let of_services = |file: &String| {
            [".service", ".dynamic", ".data", ".event", ".port_tag"]
                .iter()
                .any(|kind| file.ends_with(kind))
        };
        let own = node.id().value().to_string();
        let left: Vec<String> = files().into_iter().filter(of_services).collect();
        assert!(!left.iter().any(|file| file.contains(&own)), "{left:?}");
        assert!(left.iter().all(|file| file.contains("/nodes/")), "{left:?}");
    });
}

#[test]
fn numbers_of_nodes_name_their_process_and_are_never_the_same() {
    check(|| {
        let mut seen = Vec::new();
        for _ in 0..20 {
            let pid = in_process(node);
            Node::<S>::list(&config(), |node| {
                if let NodeState::Alive(alive) = node {
                    let id = *alive.id();
                    assert_eq!(id.pid::<S>().unwrap().value() as u32, pid);
                    assert_eq!((id.value() >> 64) as u32, pid);
                    assert_eq!(alive.details().as_ref().unwrap().name().as_str(), "client");
                    assert!(!seen.contains(&id));
                    seen.push(id);
                }
                CallbackProgression::Continue
            })
            .unwrap();
            process::kill(pid);
        }
        assert_eq!(seen.len(), 20);
        assert_eq!(clean(), 20);
        assert_eq!(files(), [""; 0]);
    });
}

#[test]
fn what_the_system_refuses_is_an_error_and_leaves_nothing() {
    let run = |seed| Run {
        failing: 50_000,
        ..run(seed)
    };
    check_with(run, || {
        let name = NodeName::new("client").unwrap();
        for _ in 0..10 {
            let node = NodeBuilder::new().name(&name).config(&config());
            let Ok(node) = node.create::<S>() else {
                continue;
            };
            let service = node
                .service_builder(&self::name("samples"))
                .publish_subscribe::<[u64]>()
                .user_header::<u64>()
                .history_size(1)
                .create();
            let Ok(service) = service else {
                continue;
            };
            let publisher = service.publisher_builder().create();
            let subscriber = service.subscriber_builder().create();
            let event = node.service_builder(&self::name("event")).event().create();
            let event = event.as_ref().ok();
            let ports = event.map(|event| {
                let listener = event.listener_builder().create();
                (listener.ok(), event.notifier_builder().create().ok())
            });
            drop((publisher.ok(), subscriber.ok(), ports));
        }
        sim_machine::calm();
        let left: Vec<_> = files();
        // iceoryx2 leaves the details of a node whose monitor it could not make
        assert!(
            left.iter().all(|file| file.ends_with("node.details")),
            "{left:?}"
        );
    });
}

#[test]
fn a_process_that_stops_keeps_its_places() {
    check(|| {
        let node = node();
        let service = create(&node, 1, 1, 0);
        let pid = in_process(|| {
            let node = self::node();
            let service = open(&node).unwrap();
            let port = subscriber(&service);
            (node, service, port)
        });
        process::stop(pid);
        assert_eq!(clean(), 0);
        assert_eq!(service.dynamic_config().number_of_subscribers(), 1);
        process::resume(pid);
        process::kill(pid);
        assert_eq!(clean(), 1);
    });
}
