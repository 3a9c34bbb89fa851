//! Samples: their order, their slots, and who comes late.

use super::*;

#[test]
fn samples_arrive_in_order_and_the_oldest_goes_when_there_is_no_room() {
    check(|| {
        let node = node();
        let service = create(&node, 2, 1, 0);
        let (publisher, subscriber) = (publisher(&service), subscriber(&service));
        // slots come back: there are never more out than there are
        for round in 0..20 {
            let count = sim_machine::random() % 5;
            for value in 0..count {
                assert_eq!(send(&publisher, 10 * round + value), 1);
            }
            let sent: Vec<u64> = (0..count).map(|value| 10 * round + value).collect();
            let kept = &sent[sent.len().saturating_sub(2)..];
            assert_eq!(values(&subscriber), kept);
        }
        assert_eq!(overwritten(), 0);
    });
}

#[test]
fn samples_are_held_up_to_a_limit_and_stay_as_they_are_when_their_sender_dies() {
    check(|| {
        let node = node();
        let service = create(&node, 1, 2, 0);
        let receiver = subscriber(&service);
        let pid = in_process(|| {
            let node = self::node();
            let service = open(&node).unwrap();
            let publisher = publisher(&service);
            thread::Builder::new()
                .spawn(move || {
                    for value in 0.. {
                        send(&publisher, value);
                        thread::sleep(Duration::from_millis(1));
                    }
                })
                .unwrap();
            (node, service)
        });
        let mut held = Vec::new();
        while held.len() < 2 {
            held.extend(receiver.receive().unwrap());
            thread::sleep(Duration::from_micros(300));
        }
        thread::sleep(Duration::from_millis(5));
        assert_eq!(
            receiver.receive().unwrap_err(),
            ReceiveError::ExceedsMaxBorrows
        );
        let seen: Vec<u64> = held.iter().map(|sample| *sample.user_header()).collect();
        process::kill(pid);
        assert_eq!(service.dynamic_config().number_of_publishers(), 1);
        assert_eq!(clean(), 1);
        assert_eq!(service.dynamic_config().number_of_publishers(), 0);
        // what was sent last is received yet
        drop(held.remove(0));
        assert!(*receiver.receive().unwrap().unwrap().user_header() > seen[1]);
        assert!(receiver.receive().unwrap().is_none());
        assert_eq!(held[0].payload(), [seen[1]; 4]);
        // another sender comes, whose slots are not those
        let publisher = publisher(&service);
        assert_eq!(send(&publisher, 7777), 1);
        assert_eq!(held[0].payload(), [seen[1]; 4]);
        assert_eq!(values(&receiver), [7777]);
    });
}

#[test]
fn a_sender_whose_slots_are_all_out_gets_an_error() {
    check(|| {
        let node = node();
        let service = create(&node, 1, 1, 0);
        let publisher = publisher(&service);
        let first = publisher.loan_slice_uninit(4).unwrap();
        let second = publisher.loan_slice_uninit(4);
        assert_eq!(second.unwrap_err(), LoanError::ExceedsMaxLoans);
        drop(first);
        let long = publisher.loan_slice_uninit(9);
        assert_eq!(long.unwrap_err(), LoanError::ExceedsMaxLoanSize);
        // two subscribers with a sample each in their buffer and in their hands, and one loan: all slots
        let receivers = [subscriber(&service), subscriber(&service)];
        assert_eq!(send(&publisher, 1), 2);
        let held = receivers
            .each_ref()
            .map(|receiver| receiver.receive().unwrap());
        for value in 2..20 {
            assert_eq!(send(&publisher, value), 2);
        }
        assert!(
            held.iter()
                .flatten()
                .all(|sample| sample.payload() == [1; 4])
        );
        assert_eq!(overwritten(), 0);
    });
}

#[test]
fn a_loan_shows_whatever_was_there() {
    check(|| {
        let node = node();
        let service = create(&node, 1, 1, 0);
        let publisher = publisher(&service);
        let loan = publisher.loan_slice_uninit(8).unwrap();
        let zeros = |entry: &MaybeUninit<u64>| {
            // SAFETY: the machine has filled it.
            unsafe { entry.assume_init() == 0 }
        };
        assert!(!loan.payload().iter().any(zeros));
    });
}

#[test]
fn who_comes_late_gets_the_last_sample_when_the_sender_looks() {
    check(|| {
        let node = node();
        let service = create(&node, 1, 2, 1);
        let publisher = publisher(&service);
        assert_eq!(send(&publisher, 5), 0);
        let first = subscriber(&service);
        thread::sleep(Duration::from_millis(100));
        assert!(first.receive().unwrap().is_none());
        publisher.update_connections().unwrap();
        assert_eq!(values(&first), [5]);
        publisher.update_connections().unwrap();
        assert!(values(&first).is_empty());
        let second = service
            .subscriber_builder()
            .history_request(0)
            .create()
            .unwrap();
        assert_eq!(send(&publisher, 6), 2);
        assert_eq!((values(&first), values(&second)), (vec![6], vec![6]));
    });
}

#[test]
fn a_receiver_that_goes_with_a_sample_in_its_hands_no_longer_protects_it() {
    check(|| {
        let node = node();
        let service = create(&node, 1, 1, 0);
        let (publisher, receiver) = (publisher(&service), subscriber(&service));
        send(&publisher, 1);
        let sample = receiver.receive().unwrap().unwrap();
        drop(receiver);
        for value in 2..400 {
            send(&publisher, value);
        }
        assert!(overwritten() > 0);
        assert_ne!(sample.payload(), [1; 4]);
    });
}

#[test]
fn a_seed_decides_every_door_of_the_transport() {
    let scenario = || {
        let pid = in_process(|| {
            let node = node();
            let service = create(&node, 1, 1, 1);
            (publisher(&service), service, node)
        });
        let node = node();
        let receiver = subscriber(&open(&node).unwrap());
        process::kill(pid);
        clean();
        drop(receiver);
    };
    let [one, same, other] = [1, 1, 2].map(|seed| run(seed).play(scenario));
    assert_eq!(one.failure, None);
    assert!(one.trace.len() > 50);
    assert_eq!(one.trace, same.trace);
    assert_ne!(one.trace, other.trace);
}
