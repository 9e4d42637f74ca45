//! Which addresses webhooks may go to: those of the public internet, and those that a setting allows.
//!
//! What is refused is what the IANA's registries of special-purpose addresses call not globally reachable
//! (<https://www.iana.org/assignments/iana-ipv4-special-registry>, <https://www.iana.org/assignments/iana-ipv6-special-registry>), and every IPv6
//! address that carries an IPv4 address that is refused.

use std::net::{IpAddr, Ipv4Addr, Ipv6Addr};

use ipnet::{IpNet, Ipv4Net, Ipv6Net};

const fn v4(a: u8, b: u8, c: u8, d: u8, prefix: u8) -> Ipv4Net {
    Ipv4Net::new_assert(Ipv4Addr::new(a, b, c, d), prefix)
}

const fn v6(head: [u16; 3], prefix: u8) -> Ipv6Net {
    let [a, b, c] = head;
    Ipv6Net::new_assert(Ipv6Addr::new(a, b, c, 0, 0, 0, 0, 0), prefix)
}

const PRIVATE: &str = "a private network";
const DOCUMENTATION: &str = "a network for documentation";
const RESERVED: &str = "a reserved network";
const TUNNEL: &str = "a tunnel from IPv6 to IPv4";

/// Networks of IPv4 that are not public.
const REFUSED_V4: [(Ipv4Net, &str); 17] = [
    (v4(0, 0, 0, 0, 8), "this network (unspecified)"),
    (v4(10, 0, 0, 0, 8), PRIVATE),
    (v4(100, 64, 0, 0, 10), "a carrier's shared network"),
    (v4(127, 0, 0, 0, 8), "loopback"),
    // The address at which machines of Azure find their host.
    (v4(168, 63, 129, 16, 32), "the host of a machine"),
    (v4(169, 254, 0, 0, 16), "link-local"),
    (v4(172, 16, 0, 0, 12), PRIVATE),
    (v4(192, 0, 0, 0, 24), RESERVED),
    (v4(192, 0, 2, 0, 24), DOCUMENTATION),
    (v4(192, 88, 99, 0, 24), TUNNEL),
    (v4(192, 168, 0, 0, 16), PRIVATE),
    (v4(198, 18, 0, 0, 15), "a network for measurements"),
    (v4(198, 51, 100, 0, 24), DOCUMENTATION),
    (v4(203, 0, 113, 0, 24), DOCUMENTATION),
    (v4(224, 0, 0, 0, 4), "multicast"),
    (v4(255, 255, 255, 255, 32), "broadcast"),
    (v4(240, 0, 0, 0, 4), RESERVED),
];

/// Networks of IPv6 that are not public. All outside of 2000::/3 is refused whatever is said here.
const REFUSED_V6: [(Ipv6Net, &str); 12] = [
    (
        Ipv6Net::new_assert(Ipv6Addr::UNSPECIFIED, 128),
        "unspecified",
    ),
    (Ipv6Net::new_assert(Ipv6Addr::LOCALHOST, 128), "loopback"),
    (v6([0xfc00, 0, 0], 7), PRIVATE),
    (v6([0xfe80, 0, 0], 10), "link-local"),
    (v6([0xfec0, 0, 0], 10), PRIVATE),
    (v6([0xff00, 0, 0], 8), "multicast"),
    (v6([0x2001, 0, 0], 32), TUNNEL),
    (v6([0x2001, 0xdb8, 0], 32), DOCUMENTATION),
    // The rest of the IETF's own: ORCHID, measurements and the like.
    (v6([0x2001, 0, 0], 23), RESERVED),
    (v6([0x2002, 0, 0], 16), TUNNEL),
    (v6([0x3fff, 0, 0], 20), DOCUMENTATION),
    (v6([0x64, 0xff9b, 1], 48), TUNNEL),
];

/// All that is assigned to the public internet.
const GLOBAL_V6: Ipv6Net = v6([0x2000, 0, 0], 3);
/// Addresses of IPv4 as an IPv6 network without IPv4 reaches them (RFC 6052).
const NAT64: Ipv6Net = v6([0x64, 0xff9b, 0], 96);

/// Checks that webhooks may go to an address.
///
/// # Errors
/// What kind of address it is instead.
pub fn check(address: IpAddr, allowed: &[IpNet]) -> Result<(), &'static str> {
    let (address, embedded) = (address.to_canonical(), embedded_v4(address));
    let is_allowed = |address: IpAddr| allowed.iter().any(|network| network.contains(&address));
    if is_allowed(address) || embedded.is_some_and(|it| is_allowed(it.into())) {
        return Ok(());
    }
    match (address, embedded) {
        (IpAddr::V4(address), _) | (IpAddr::V6(_), Some(address)) => check_v4(address),
        (IpAddr::V6(address), None) => check_v6(address),
    }
}

/// The IPv4 address that a translated IPv6 address stands for.
fn embedded_v4(address: IpAddr) -> Option<Ipv4Addr> {
    match address {
        IpAddr::V6(address) if NAT64.contains(&address) => {
            let [.., a, b, c, d] = address.octets();
            Some(Ipv4Addr::new(a, b, c, d))
        }
        _ => None,
    }
}

fn check_v4(address: Ipv4Addr) -> Result<(), &'static str> {
    let mut refused = REFUSED_V4.iter();
    match refused.find(|(network, _)| network.contains(&address)) {
        Some((_, kind)) => Err(kind),
        None => Ok(()),
    }
}

fn check_v6(address: Ipv6Addr) -> Result<(), &'static str> {
    let mut refused = REFUSED_V6.iter();
    match refused.find(|(network, _)| network.contains(&address)) {
        Some((_, kind)) => Err(kind),
        None if GLOBAL_V6.contains(&address) => Ok(()),
        None => Err(RESERVED),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn kind(address: &str, allowed: &[&str]) -> Option<&'static str> {
        let allowed: Vec<IpNet> = allowed.iter().map(|text| text.parse().unwrap()).collect();
        check(address.parse().unwrap(), &allowed).err()
    }

    #[test]
    fn addresses_that_are_not_public_are_refused() {
        for (address, expected) in [
            ("0.0.0.0", "this network (unspecified)"),
            ("0.1.2.3", "this network (unspecified)"),
            ("10.0.0.1", PRIVATE),
            ("10.255.255.255", PRIVATE),
            ("100.64.0.1", "a carrier's shared network"),
            ("100.127.255.255", "a carrier's shared network"),
            ("127.0.0.1", "loopback"),
            ("127.255.255.254", "loopback"),
            ("168.63.129.16", "the host of a machine"),
            ("169.254.169.254", "link-local"),
            ("172.16.0.1", PRIVATE),
            ("172.31.255.255", PRIVATE),
            ("192.0.0.8", RESERVED),
            ("192.0.2.1", DOCUMENTATION),
            ("192.88.99.1", TUNNEL),
            ("192.168.1.1", PRIVATE),
            ("198.18.0.1", "a network for measurements"),
            ("198.19.255.255", "a network for measurements"),
            ("198.51.100.7", DOCUMENTATION),
            ("203.0.113.9", DOCUMENTATION),
            ("224.0.0.1", "multicast"),
            ("239.255.255.255", "multicast"),
            ("240.0.0.1", RESERVED),
            ("255.255.255.255", "broadcast"),
            ("::", "unspecified"),
            ("::1", "loopback"),
            // IPv4 in IPv6: mapped, compatible, translated.
            ("::ffff:127.0.0.1", "loopback"),
            ("::ffff:10.0.0.1", PRIVATE),
            ("::ffff:169.254.169.254", "link-local"),
            ("::127.0.0.1", RESERVED),
            ("::8.8.8.8", RESERVED),
            ("64:ff9b::127.0.0.1", "loopback"),
            ("64:ff9b::a9fe:a9fe", "link-local"),
            ("64:ff9b::10.0.0.1", PRIVATE),
            ("64:ff9b:1::10.0.0.1", TUNNEL),
            ("64:ff9b:1::8.8.8.8", TUNNEL),
            ("64:ff9b:2::1", RESERVED),
            ("100::1", RESERVED),
            ("2001::7f00:1", TUNNEL),
            ("2001:2::1", RESERVED),
            ("2001:20::1", RESERVED),
            ("2001:db8::1", DOCUMENTATION),
            ("2002:7f00:1::1", TUNNEL),
            ("2002:808:808::1", TUNNEL),
            ("3fff::1", DOCUMENTATION),
            ("4000::1", RESERVED),
            ("5f00::1", RESERVED),
            ("fc00::1", PRIVATE),
            ("fd00:ec2::254", PRIVATE),
            ("fe80::1", "link-local"),
            ("febf::1", "link-local"),
            ("fec0::1", PRIVATE),
            ("ff02::1", "multicast"),
        ] {
            assert_eq!(kind(address, &[]), Some(expected), "{address}");
        }
    }

    #[test]
    fn public_addresses_are_taken() {
        for address in [
            "1.1.1.1",
            "8.8.8.8",
            "9.255.255.255",
            "11.0.0.0",
            "100.63.255.255",
            "100.128.0.0",
            "126.255.255.255",
            "128.0.0.0",
            "168.63.129.17",
            "169.253.255.255",
            "169.255.0.0",
            "172.15.255.255",
            "172.32.0.0",
            "192.0.1.1",
            "192.167.255.255",
            "192.169.0.0",
            "198.17.255.255",
            "198.20.0.0",
            "223.255.255.255",
            "::ffff:8.8.8.8",
            "64:ff9b::8.8.8.8",
            "2001:4860:4860::8888",
            "2606:4700:4700::1111",
            "2a00:1450:4001::1",
        ] {
            assert_eq!(kind(address, &[]), None, "{address}");
        }
    }

    #[test]
    fn a_setting_allows_networks_and_nothing_beside_them() {
        let allowed = ["10.1.0.0/16", "::1/128"];
        for address in ["10.1.2.3", "::1", "::ffff:10.1.2.3", "64:ff9b::10.1.2.3"] {
            assert_eq!(kind(address, &allowed), None, "{address}");
        }
        for address in ["10.2.0.0", "127.0.0.1", "::ffff:10.2.0.0", "fe80::1"] {
            assert!(kind(address, &allowed).is_some(), "{address}");
        }
    }
}
