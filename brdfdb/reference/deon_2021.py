"""d'Eon 2021 at 40 digits: a deep layer of Lambertian spheres, as the author's program evaluates it."""

from brdfdb.reference import Number, mp


def lambert_sphere(theta_i: Number, theta_r: Number, delta_phi: Number, rho: Number) -> Number:
    """Return f_r [1/sr] of a layer of spheres of albedo `rho` [1]: the first scattering, and a fit of the others."""
    c = mp.mpf(rho)
    ui, uo = mp.cos(theta_i), mp.cos(theta_r)
    sines = mp.sin(theta_i) * mp.sin(theta_r) * mp.cos(delta_phi)
    first = c * phase_function(-(ui * uo + sines)) / (ui + uo)
    first_mean = c / mp.pi * (207 + 256 * ui * uo - 45 * uo**2 + 45 * ui**2 * (-1 + 3 * uo**2)) / (768 * (ui + uo))
    return max(mp.zero, first + mean(ui, uo, c) - first_mean + first_cosine(ui, uo, c) * sines)


def phase_function(u: Number) -> Number:
    """Return the phase function [1/sr] of a Lambertian sphere at the cosine `u` of the angle of deflection."""
    u = min(mp.one, max(-mp.one, u))
    return 2 * (mp.sqrt(1 - u**2) - u * mp.acos(u)) / (3 * mp.pi**2)


def mean(ui: Number, uo: Number, c: Number) -> Number:
    """Return the mean of f_r over azimuths [1/sr] for cosines `ui` and `uo`."""
    root, square = mp.sqrt(1 - c), 1 - c
    cube = root * square
    A = 69 * c / 128
    B = (
        mp.mpf("-0.08446297239646791")
        + mp.mpf("0.5153566145541554") * root
        - mp.mpf("0.77757371002123") * square
        + mp.mpf("0.34668869623791543") * cube
    ) / (mp.mpf("0.9648932738041012") - mp.mpf("0.6655015709030936") * root + mp.mpf("0.1826019462608555") * square)
    C = (
        mp.mpf("682.8479477533338")
        - mp.mpf("2567.7368047535556") * root
        + mp.mpf("7487.987105705168") * square
        - mp.mpf("5602.448801045478") * cube
    ) / (mp.mpf("5850.602606063662") - mp.mpf("4008.3309624647227") * root + mp.mpf("1480.250743805733") * square)
    D = (
        mp.mpf("0.2855294320307508")
        + mp.mpf("160.39651500649123") * root
        - mp.mpf("327.42799697993706") * square
        + mp.mpf("166.88327184107732") * cube
    ) / (mp.mpf("674.1908010450103") - mp.mpf("412.9837444306491") * root + mp.mpf("596.4232294419696") * square)
    E = 15 * square * c * (3 + 4 * c / 3) / 128
    F = (
        mp.mpf("-1.9208967199948512")
        - mp.mpf("242.16001167844007") * root
        - mp.mpf("21.914139454773085") * square
        + mp.mpf("266.06342182761813") * cube
    ) / (mp.mpf("1499.904420175135") + mp.mpf("457.4200839912641") * root + mp.mpf("215.77342164754094") * square)
    polynomial = A + C * ui * uo + E * ui**2 * uo**2 + B * (ui + uo) + D * ui * uo * (ui + uo) + F * (ui**2 + uo**2)
    return h0(ui, c) * h0(uo, c) / (2 * mp.pi * (ui + uo)) * polynomial


def first_cosine(ui: Number, uo: Number, c: Number) -> Number:
    """Return the factor [1/sr] of sin(theta_i) sin(theta_r) cos(delta_phi) in f_r, without the first scattering."""
    l = mp.mpf("-0.05890107167021953") * c - mp.mpf("0.004740543453386809") * c**2  # noqa: E741 - as in the program
    H = h1(ui, c) * h1(uo, c)
    terms = (
        c * (64 + 45 * ui * uo) / 48
        - 15 * (1 + mp.mpf("0.44") * c) * c * ui * uo * H / 16
        - 4 * c * (1 + l * ui) * (1 + l * uo) * H / 3
    )
    return -2 / mp.pi * terms / (8 * (ui + uo))


def h0(u: Number, c: Number) -> Number:
    """Return the H function [1] of the mean over azimuths, eq. (37)."""
    root = mp.sqrt(1 - c)
    a = mp.mpf("8.216443463470172") + mp.mpf("1.501116252342486") * root ** mp.mpf("6.054351911707695")
    a /= mp.mpf("4.175932557866179") - mp.mpf("1.2122216865199813") * root
    d = mp.mpf("7.773097842804312") - mp.mpf("0.5658108102188075") * root ** mp.mpf("0.9615460393324836")
    d /= mp.mpf("8.659120811349371") - mp.mpf("0.15997430541238322") * root**7
    loss = mp.sqrt(max(mp.zero, 1 - 2 * (89 * c / 288 + 59 * c**2 / 288 - c**3 / 72)))
    return (1 + a * u**d) / (1 + a * loss * u**d)


def h1(u: Number, c: Number) -> Number:
    """Return the H function [1] of the first cosine of the azimuth."""
    power = (
        mp.mpf("0.45944184025347456")
        - mp.mpf("1.0787917226917565") * u
        + mp.mpf("1.8572804924335546") * u**2
        - mp.mpf("1.1283119660147671") * u**3
    )
    return mp.exp((mp.mpf("-0.14483935877260054") * c + mp.mpf("0.024285125615255733") * c**2) * u**power)
