//! Requests and their answers.

use super::*;

type Requester = Client<S, [u8], (), [u8], ()>;
type Responder = Server<S, [u8], (), [u8], ()>;

fn control(node: &Node<S>) -> (Responder, Requester) {
    let service = node
        .service_builder(&name("control"))
        .request_response::<[u8], [u8]>()
        .max_clients(2)
        .max_servers(1)
        .max_nodes(3)
        .max_active_requests_per_client(2)
        .max_loaned_requests(1)
        .max_response_buffer_size(1)
        .max_borrowed_responses_per_pending_response(1)
        .enable_fire_and_forget_requests(true)
        .create()
        .unwrap();
    let server = service.server_builder().initial_max_slice_len(64);
    let server = server.max_loaned_responses_per_request(1).create().unwrap();
    let client = service.client_builder().initial_max_slice_len(64);
    (server, client.create().unwrap())
}

fn ask(
    client: &Requester,
    text: &[u8],
) -> sim_machine::iceoryx2::pending_response::PendingResponse<S, [u8], (), [u8], ()> {
    let loan = client.loan_slice_uninit(text.len()).unwrap();
    loan.write_from_slice(text).send().unwrap()
}

#[test]
fn requests_are_answered_each_by_its_own() {
    check(|| {
        let node = node();
        let (server, client) = control(&node);
        let [first, second] = [ask(&client, b"first"), ask(&client, b"second")];
        let loan = client
            .loan_slice_uninit(5)
            .unwrap()
            .write_from_slice(b"third");
        assert_eq!(
            loan.send().map(drop).unwrap_err(),
            RequestSendError::ExceedsMaxActiveRequests
        );
        let mut active = Vec::new();
        while let Some(request) = server.receive().unwrap() {
            assert_eq!(request.origin(), client.id());
            active.push(request);
        }
        active.reverse();
        for request in active {
            let answer = request.payload().to_ascii_uppercase();
            let loan = request.loan_slice_uninit(answer.len()).unwrap();
            loan.write_from_slice(&answer).send().unwrap();
        }
        let [first, second] = [first, second].map(|pending| pending.receive().unwrap().unwrap());
        assert_eq!(first.payload(), b"FIRST");
        assert_eq!(second.payload(), b"SECOND");
    });
}

#[test]
fn requests_that_nobody_awaits_are_served_and_the_oldest_unread_ones_go() {
    check(|| {
        let node = node();
        let (server, client) = control(&node);
        for number in 0..20_u8 {
            drop(ask(&client, &[number]));
        }
        let mut served = Vec::new();
        while let Some(request) = server.receive().unwrap() {
            served.push(request.payload()[0]);
            let loan = request.loan_slice_uninit(1).unwrap();
            loan.write_from_slice(&[0]).send().unwrap();
        }
        assert_eq!(served, [18, 19]);
        // old answers are for nobody
        for number in 0..20_u8 {
            let pending = ask(&client, &[number]);
            assert!(pending.receive().unwrap().is_none());
            let request = server.receive().unwrap().unwrap();
            let loan = request.loan_slice_uninit(1).unwrap();
            loan.write_from_slice(&[number]).send().unwrap();
            assert_eq!(pending.receive().unwrap().unwrap().payload(), [number]);
        }
    });
}

#[test]
fn a_client_that_died_is_listed_until_it_is_cleaned_up_and_its_requests_are_served_until_then() {
    check(|| {
        let node = node();
        let (server, client) = control(&node);
        let pid = in_process(|| {
            let node = self::node();
            let service = node
                .service_builder(&name("control"))
                .request_response::<[u8], [u8]>()
                .open()
                .unwrap();
            let client = service.client_builder().initial_max_slice_len(64);
            let client = client.create().unwrap();
            drop(ask(&client, b"last words"));
            (node, service, client)
        });
        process::kill(pid);
        let service = node
            .service_builder(&name("control"))
            .request_response::<[u8], [u8]>()
            .open()
            .unwrap();
        assert_eq!(service.dynamic_config().number_of_clients(), 2);
        let request = server.receive().unwrap().unwrap();
        assert_eq!(request.payload(), b"last words");
        let mut listed = false;
        service.dynamic_config().list_clients(|details| {
            listed |= details.client_id == request.origin();
            CallbackProgression::Continue
        });
        assert!(listed);
        clean();
        assert_eq!(service.dynamic_config().number_of_clients(), 1);
        // nobody reads it
        let loan = request.loan_slice_uninit(1).unwrap();
        loan.write_from_slice(b"x").send().unwrap();
        drop(request);
        drop(ask(&client, b"ours"));
        assert_eq!(server.receive().unwrap().unwrap().payload(), b"ours");
    });
}
