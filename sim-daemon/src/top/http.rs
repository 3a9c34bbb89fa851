//! Answers scrapes over HTTP on the loopback interface, whatever else connects: every connection has limits of its own.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::convert::Infallible;
use std::net::{SocketAddr, TcpListener, ToSocketAddrs};
use std::ops::ControlFlow;
use std::rc::Rc;
use std::time::{Duration, Instant};

use http_body_util::Full;
use hyper::body::{Body, Bytes, Incoming};
use hyper::header::{CONNECTION, CONTENT_TYPE, HOST, HeaderValue};
use hyper::http::uri::Authority;
use hyper::server::conn::http1;
use hyper::service::service_fn;
use hyper::{Method, Request, Response, StatusCode, Version};
use hyper_util::rt::{TokioIo, TokioTimer};
use sim_protocol::ProtocolError;
use tokio::runtime::Builder;
use tokio::task::{AbortHandle, JoinSet, LocalSet};
use tokio::time::timeout;

use super::look::Watched;
use super::metrics::text;
use crate::error::DaemonError;
use crate::output;

/// A request head is complete this long after the connection.
const HEAD_MAX: Duration = Duration::from_secs(2);
/// A connection ends this long after it began, also one whose answer nobody reads.
const CONNECTION_MAX: Duration = Duration::from_secs(10);
/// Bytes of a request head at most; hyper takes no less.
const HEAD_BYTES: usize = 8192;
/// Header lines of a request at most.
const HEADERS: usize = 64;
/// Connections at once. One more ends the oldest, so that no number of idle ones keeps a scrape out.
const CONNECTIONS: usize = 64;
/// A daemon at long work is waited for this long; other scrapes wait meanwhile.
const LOOK_MAX: Duration = Duration::from_secs(1);
/// Pause after a connection that could not be taken, for example since files are too many.
const REST: Duration = Duration::from_millis(50);

type Answer = Response<Full<Bytes>>;

/// Answers scrapes until the daemon ends.
///
/// # Errors
/// An address that is not of this machine alone, or is taken; the end of the daemon.
pub(super) fn serve(address: &str, watched: Watched) -> Result<(), DaemonError> {
    let listener = listen(address)?;
    let failed = |action, error: std::io::Error| DaemonError::System {
        action,
        problem: error.to_string(),
    };
    let place = listener
        .local_addr()
        .map_err(|error| failed("listen", error))?;
    let runtime = Builder::new_current_thread().enable_all().build();
    let runtime = runtime.map_err(|error| failed("start a server", error))?;
    output::print(format!("http://{place}/metrics\n").as_bytes()).map_err(DaemonError::stdout)?;
    let scrapes = Rc::new(Scrapes {
        place,
        named: host_of(address).to_ascii_lowercase(),
        watched: RefCell::new(watched),
        ended: RefCell::new(None),
    });
    LocalSet::new().block_on(&runtime, accept(listener, scrapes))
}

fn listen(address: &str) -> Result<TcpListener, DaemonError> {
    let wrong = |problem: String| DaemonError::Argument {
        argument: "metrics",
        value: address.to_owned(),
        problem,
    };
    let addresses: Vec<SocketAddr> = address
        .to_socket_addrs()
        .map_err(|error| wrong(format!("{error}; give an address such as 127.0.0.1:9400")))?
        .collect();
    if let Some(other) = addresses.iter().find(|each| !each.ip().is_loopback()) {
        let problem = format!(
            "others would reach {other}; give 127.0.0.1, and let a proxy with access rules pass it on"
        );
        return Err(wrong(problem));
    }
    let busy = |error| wrong(format!("{error}; give a port that is free"));
    let listener = TcpListener::bind(&addresses[..]).map_err(busy)?;
    listener.set_nonblocking(true).map_err(busy)?;
    Ok(listener)
}

/// The host of `host:port`.
fn host_of(address: &str) -> &str {
    address.rsplit_once(':').map_or(address, |(host, _)| host)
}

/// What every connection asks.
struct Scrapes {
    place: SocketAddr,
    /// The host that the user gave, in lower case.
    named: String,
    watched: RefCell<Watched>,
    /// Why the daemon can be asked no more.
    ended: RefCell<Option<DaemonError>>,
}

async fn accept(listener: TcpListener, scrapes: Rc<Scrapes>) -> Result<(), DaemonError> {
    let listener =
        tokio::net::TcpListener::from_std(listener).map_err(|error| DaemonError::System {
            action: "listen",
            problem: error.to_string(),
        })?;
    let mut open = JoinSet::new();
    let mut order: VecDeque<AbortHandle> = VecDeque::new();
    loop {
        tokio::select! {
            biased;
            Some(_) = open.join_next() => {
                order.retain(|task| !task.is_finished());
                if let Some(error) = scrapes.ended.take() {
                    return Err(error);
                }
            }
            accepted = listener.accept() => match accepted {
                Ok((stream, _)) => {
                    if order.len() >= CONNECTIONS
                        && let Some(oldest) = order.pop_front()
                    {
                        oldest.abort();
                    }
                    order.push_back(open.spawn_local(connection(stream, Rc::clone(&scrapes))));
                }
                Err(_) => tokio::time::sleep(REST).await,
            },
        }
    }
}

async fn connection(stream: tokio::net::TcpStream, scrapes: Rc<Scrapes>) {
    let answer = |request| {
        let answer = scrapes.answer(&request);
        async move { Ok::<_, Infallible>(answer) }
    };
    let served = http1::Builder::new()
        .timer(TokioTimer::new())
        .header_read_timeout(HEAD_MAX)
        .max_buf_size(HEAD_BYTES)
        .max_headers(HEADERS)
        .keep_alive(false)
        .serve_connection(TokioIo::new(stream), service_fn(answer));
    // who asked may be gone, or may have asked for nonsense
    let _ = timeout(CONNECTION_MAX, served).await;
}

impl Scrapes {
    /// The body of a request is not read, whatever its length says.
    fn answer(&self, request: &Request<Incoming>) -> Answer {
        let hosts: Vec<_> = request.headers().get_all(HOST).iter().collect();
        if !self.is_for_us(&hosts, request.version()) {
            return answer(
                StatusCode::MISDIRECTED_REQUEST,
                "this Host is not served; ask for localhost, or let a proxy set the header Host\n",
            );
        }
        if request.method() != Method::GET {
            return answer(StatusCode::METHOD_NOT_ALLOWED, "GET only\n");
        }
        if !matches!(request.uri().path(), "/" | "/metrics") {
            return answer(StatusCode::NOT_FOUND, "ask for /metrics\n");
        }
        if !request.body().is_end_stream() {
            let refused = "a scrape has no body; leave it out\n";
            return answer(StatusCode::PAYLOAD_TOO_LARGE, refused);
        }
        let begin = Instant::now();
        let mut patience = || match begin.elapsed() < LOOK_MAX {
            true => ControlFlow::Continue(()),
            false => ControlFlow::Break(()),
        };
        match self.watched.borrow_mut().look(&mut patience) {
            Ok(look) => answer(StatusCode::OK, text(&look)),
            Err(ProtocolError::Interrupted | ProtocolError::Timeout { .. }) => answer(
                StatusCode::SERVICE_UNAVAILABLE,
                "the daemon is at long work; ask again later\n",
            ),
            Err(error) => {
                *self.ended.borrow_mut() = Some(error.into());
                answer(StatusCode::SERVICE_UNAVAILABLE, "the daemon has ended\n")
            }
        }
    }

    /// Whether a request names this server. A page of the web that lets its own name point here does not: a browser would
    /// show it the answer.
    fn is_for_us(&self, hosts: &[&HeaderValue], version: Version) -> bool {
        match hosts {
            // programs of the first version know no Host, and no browser is among them
            [] => version == Version::HTTP_10,
            [host] => host
                .to_str()
                .ok()
                .and_then(|host| host.parse::<Authority>().ok())
                .is_some_and(|host| self.serves(&host)),
            _ => false,
        }
    }

    fn serves(&self, host: &Authority) -> bool {
        // a name before @ would hide which host it is
        if host.as_str().contains('@') {
            return false;
        }
        let name = host.host().to_ascii_lowercase();
        let ip = self.place.ip().to_string();
        ["localhost", "127.0.0.1", "[::1]", &self.named, &ip].contains(&name.as_str())
    }
}

fn answer(status: StatusCode, body: impl Into<Bytes>) -> Answer {
    let mut answer = Response::new(Full::new(body.into()));
    *answer.status_mut() = status;
    let headers = answer.headers_mut();
    let kind = HeaderValue::from_static("text/plain; version=0.0.4");
    headers.insert(CONTENT_TYPE, kind);
    headers.insert(CONNECTION, HeaderValue::from_static("close"));
    answer
}
