//! Notifications and those who wait for them.

use super::*;

fn events(node: &Node<S>) -> (Listener<S>, Notifier<S>) {
    let service = node.service_builder(&name("event")).event();
    let service = service.max_listeners(1).max_nodes(2).create().unwrap();
    let listener = service.listener_builder().create().unwrap();
    (listener, service.notifier_builder().create().unwrap())
}

#[test]
fn a_notification_wakes_at_once_and_is_kept_for_who_does_not_sleep_yet() {
    check(|| {
        let node = node();
        let (listener, notifier) = events(&node);
        assert_eq!(notifier.notify(), Ok(1));
        let hour = Duration::from_secs(3600);
        let start = Instant::now();
        listener.timed_wait(|_| {}, hour).unwrap();
        assert!(start.elapsed() < Duration::from_millis(10));
        // drained
        let mut waits = 0;
        while start.elapsed() < Duration::from_secs(1) && waits < 5 {
            listener.timed_wait(|_| {}, Duration::from_secs(1)).unwrap();
            waits += 1;
        }
        assert!(waits < 5, "it ends for nothing, but rarely");
        let start = Instant::now();
        thread::Builder::new()
            .spawn(move || {
                thread::sleep(Duration::from_millis(200));
                notifier.notify().unwrap();
                thread::sleep(hour);
            })
            .unwrap();
        while start.elapsed() < Duration::from_millis(200) {
            listener.timed_wait(|_| {}, hour).unwrap();
        }
        assert!(start.elapsed() < Duration::from_millis(210));
    });
}

#[test]
fn where_notifications_are_lost_a_wait_ends_by_its_timeout() {
    let run = |seed| Run {
        dropping: 500_000,
        ..run(seed)
    };
    check_with(run, || {
        let node = node();
        let (listener, notifier) = events(&node);
        let mut lost = 0;
        for _ in 0..40 {
            notifier.notify().unwrap();
            let start = Instant::now();
            listener
                .timed_wait(|_| {}, Duration::from_millis(50))
                .unwrap();
            let passed = start.elapsed();
            assert!(passed < Duration::from_millis(60));
            lost += u32::from(passed > Duration::from_millis(49));
        }
        assert!((5..35).contains(&lost), "{lost}");
    });
}

#[test]
fn an_event_service_has_as_many_nodes_and_listeners_as_it_says() {
    check(|| {
        let nodes = [node(), node(), node()];
        let (listener, _notifier) = events(&nodes[0]);
        let open = |node: &Node<S>| node.service_builder(&name("event")).event().open();
        let second = open(&nodes[1]).unwrap();
        assert!(second.listener_builder().create().is_err());
        let third = open(&nodes[2]).map(drop);
        assert_eq!(third.unwrap_err(), EventOpenError::ExceedsMaxNumberOfNodes);
        drop(listener);
        assert!(second.listener_builder().create().is_ok());
        drop(second);
        assert!(open(&nodes[2]).is_ok());
    });
}
