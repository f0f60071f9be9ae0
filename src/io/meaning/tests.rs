use super::*;

/// As a library of today writes EPSG:25832, without what is no part of its meaning.
const WKT2: &str = "PROJCRS[\"ETRS89 / UTM zone 32N\",BASEGEOGCRS[\"ETRS89\",\
    ENSEMBLE[\"European Terrestrial Reference System 1989 ensemble\",\
    MEMBER[\"European Terrestrial Reference Frame 1989\"],\
    ELLIPSOID[\"GRS 1980\",6378137,298.257222101,LENGTHUNIT[\"metre\",1]],\
    ENSEMBLEACCURACY[0.1]],PRIMEM[\"Greenwich\",0,ANGLEUNIT[\"degree\",0.0174532925199433]]],\
    CONVERSION[\"UTM zone 32N\",METHOD[\"Transverse Mercator\",ID[\"EPSG\",9807]],\
    PARAMETER[\"Latitude of natural origin\",0,ANGLEUNIT[\"degree\",0.0174532925199433]],\
    PARAMETER[\"Longitude of natural origin\",9,ANGLEUNIT[\"degree\",0.0174532925199433]],\
    PARAMETER[\"Scale factor at natural origin\",0.9996,SCALEUNIT[\"unity\",1]],\
    PARAMETER[\"False easting\",500000,LENGTHUNIT[\"metre\",1]],\
    PARAMETER[\"False northing\",0,LENGTHUNIT[\"metre\",1]]],CS[Cartesian,2],\
    AXIS[\"(E)\",east,ORDER[1],LENGTHUNIT[\"metre\",1]],\
    AXIS[\"(N)\",north,ORDER[2],LENGTHUNIT[\"metre\",1]]]";
const ESRI: &str = "PROJCS[\"ETRS_1989_UTM_Zone_32N\",GEOGCS[\"GCS_ETRS_1989\",\
    DATUM[\"D_ETRS_1989\",SPHEROID[\"GRS_1980\",6378137.0,298.257222101]],\
    PRIMEM[\"Greenwich\",0.0],UNIT[\"Degree\",0.0174532925199433]],\
    PROJECTION[\"Transverse_Mercator\"],PARAMETER[\"False_Easting\",500000.0],\
    PARAMETER[\"False_Northing\",0.0],PARAMETER[\"Central_Meridian\",9.0],\
    PARAMETER[\"Scale_Factor\",0.9996],PARAMETER[\"Latitude_Of_Origin\",0.0],\
    UNIT[\"Meter\",1.0]]";
/// EPSG:2277, in feet: two parallels in the other order, more digits.
const TEXAS: &str = "PROJCS[\"NAD_1983_StatePlane_Texas_Central_FIPS_4203_Feet\",\
    GEOGCS[\"GCS_North_American_1983\",DATUM[\"D_North_American_1983\",\
    SPHEROID[\"GRS_1980\",6378137.0,298.257222101]],PRIMEM[\"Greenwich\",0.0],\
    UNIT[\"Degree\",0.0174532925199433]],PROJECTION[\"Lambert_Conformal_Conic\"],\
    PARAMETER[\"False_Easting\",2296583.333333333],PARAMETER[\"False_Northing\",9842500.0],\
    PARAMETER[\"Central_Meridian\",-100.3333333333333],\
    PARAMETER[\"Standard_Parallel_1\",31.88333333333333],\
    PARAMETER[\"Standard_Parallel_2\",30.11666666666667],\
    PARAMETER[\"Latitude_Of_Origin\",29.66666666666667],UNIT[\"Foot_US\",0.3048006096012192]]";
const NAVD: &str = "VERTCS[\"NAVD_1988\",VDATUM[\"North_American_Vertical_Datum_1988\"],\
    PARAMETER[\"Vertical_Shift\",0.0],PARAMETER[\"Direction\",1.0],\
    UNIT[\"Foot_US\",0.3048006096012192]]";

fn same(one: &str, two: &str) -> bool {
    let [one, two] =
        [one, two].map(|text| SystemMeaning::of(text).unwrap_or_else(|| panic!("{text}")));
    assert_eq!(one.is(&two), two.is(&one));
    one.is(&two)
}

#[test]
fn one_system_in_four_spellings_is_one() {
    let gdal = epsg::wkt(25832, None).unwrap();
    for one in ["EPSG:25832", &gdal, WKT2, ESRI] {
        for two in ["EPSG:25832", &gdal, WKT2, ESRI] {
            assert!(same(one, two), "{one} {two}");
        }
    }
    assert!(same("EPSG:2277", TEXAS));
    let bound = format!("BOUNDCRS[SOURCECRS[{gdal}],TARGETCRS[GEOGCRS[\"x\"]]]");
    assert!(same(&bound, ESRI));
    // Axes named in another order.
    let axes = [WKT2.replace("[\"(E)\",east", "[\"(E)\",north"), WKT2.to_owned()];
    assert!(same(&axes[0], &axes[1]));
}

#[test]
fn heights_are_part_of_a_system() {
    let [inside, behind] =
        [format!("{},{NAVD}]", &TEXAS[..TEXAS.len() - 1]), format!("{TEXAS},{NAVD}")];
    assert!(same("EPSG:2277+6360", &inside) && same("EPSG:2277+6360", &behind));
    assert!(same("EPSG:5555", "EPSG:25832+5783"), "a code of a compound system");
    for other in ["EPSG:2277", "EPSG:2277+5703", "EPSG:2277+8228"] {
        assert!(!same(other, &inside), "{other}");
    }
    let deep = inside.replace("Direction\",1.0", "Direction\",-1.0");
    assert!(!same(&deep, &inside));
    assert_eq!(SystemMeaning::of(&inside.replace("Shift\",0.0", "Shift\",1.5")), None);
}

#[test]
fn what_differs_in_a_number_or_a_name_is_another_system() {
    for (from, to) in [
        ("Meridian\",9.0", "Meridian\",9.00001"),
        ("Easting\",500000.0", "Easting\",500000.001"),
        ("0.9996", "0.9997"),
        ("298.257222101", "298.257223563"),
        ("D_ETRS_1989", "D_ETRF_1989"),
        ("Greenwich\",0.0", "Paris\",2.33722917"),
        ("\"Meter\",1.0", "\"Foot\",0.3048"),
        ("Transverse_Mercator", "Transverse_Mercator_South_Oriented"),
    ] {
        let other = ESRI.replace(from, to);
        assert_ne!(other, ESRI);
        assert!(!same(&other, ESRI), "{to}");
    }
    assert!(!same("EPSG:25832", "EPSG:32632") && !same("EPSG:4258", "EPSG:25832"));
    assert!(!same("EPSG:26910", "EPSG:6339"), "NAD83 and NAD83(2011)");
}

#[test]
fn of_what_leaves_something_open_nothing_is_known() {
    for (from, to) in [
        ("PARAMETER[\"Central_Meridian\",9.0],", ""),
        ("\"Scale_Factor\"", "\"Ex_Factor\""),
        ("D_ETRS_1989", "Unknown"),
        (",UNIT[\"Meter\",1.0]", ""),
        ("SPHEROID[\"GRS_1980\",6378137.0,298.257222101]", ""),
        (",UNIT[\"Meter\",1.0]]", ",UNIT[\"Meter\",1.0],EXTENSION[\"PROJ4\",\"+proj=x\"]]"),
    ] {
        let other = ESRI.replace(from, to);
        assert_ne!(other, ESRI);
        assert_eq!(SystemMeaning::of(&other), None, "{to}");
    }
    for text in ["", "EPSG:1", "LOCAL_CS[\"x\",UNIT[\"metre\",1]]", &format!("{ESRI},{ESRI}")] {
        assert_eq!(SystemMeaning::of(text), None, "{text}");
    }
}

#[test]
fn numbers_that_are_far_apart_contradict_each_other() {
    let of = |text: &str| SystemMeaning::of(text).unwrap();
    let moved = ESRI.replace("Meridian\",9.0", "Meridian\",15.0");
    assert!(of(ESRI).contradicts(&of(&moved)) && !of(ESRI).contradicts(&of(WKT2)));
    let rounded = ESRI.replace("Meridian\",9.0", "Meridian\",9.000001");
    assert!(!of(ESRI).contradicts(&of(&rounded)) && !of(ESRI).is(&of(&rounded)));
}

#[test]
fn a_text_that_belies_its_code_is_none() {
    let with =
        |code: u32| format!("{},AUTHORITY[\"EPSG\",\"{code}\"]]", ESRI.strip_suffix(']').unwrap());
    assert!(same(&with(25832), WKT2) && same(&with(25832), "EPSG:25832"));
    assert_eq!(SystemMeaning::of(&with(25833)), None);
    assert!(SystemMeaning::said(&with(25833)).is_some());
}

#[test]
fn methods_with_two_names_or_a_missing_parameter_are_one() {
    let hotine = "PROJCS[\"x\",GEOGCS[\"x\",DATUM[\"D_CH1903+\",\
        SPHEROID[\"Bessel_1841\",6377397.155,299.1528128]],PRIMEM[\"Greenwich\",0.0],\
        UNIT[\"Degree\",0.0174532925199433]],PROJECTION[\"Hotine_Oblique_Mercator_Azimuth_Center\"],\
        PARAMETER[\"False_Easting\",2600000.0],PARAMETER[\"False_Northing\",1200000.0],\
        PARAMETER[\"Scale_Factor\",1.0],PARAMETER[\"Azimuth\",90.0],\
        PARAMETER[\"Longitude_Of_Center\",7.43958333333333],\
        PARAMETER[\"Latitude_Of_Center\",46.9524055555556],UNIT[\"Meter\",1.0]]";
    assert!(same("EPSG:2056", hotine));
    let polar = "PROJCS[\"x\",GEOGCS[\"x\",DATUM[\"D_WGS_1984\",\
        SPHEROID[\"WGS_1984\",6378137.0,298.257223563]],PRIMEM[\"Greenwich\",0.0],\
        UNIT[\"Degree\",0.0174532925199433]],PROJECTION[\"Stereographic_South_Pole\"],\
        PARAMETER[\"False_Easting\",0.0],PARAMETER[\"False_Northing\",0.0],\
        PARAMETER[\"Central_Meridian\",0.0],PARAMETER[\"Standard_Parallel_1\",-71.0],\
        UNIT[\"Meter\",1.0]]";
    assert!(same("EPSG:3031", polar) && !same("EPSG:3032", polar));
    let web = "PROJCS[\"x\",GEOGCS[\"x\",DATUM[\"D_WGS_1984\",\
        SPHEROID[\"WGS_1984\",6378137.0,298.257223563]],PRIMEM[\"Greenwich\",0.0],\
        UNIT[\"Degree\",0.0174532925199433]],PROJECTION[\"Mercator_Auxiliary_Sphere\"],\
        PARAMETER[\"False_Easting\",0.0],PARAMETER[\"False_Northing\",0.0],\
        PARAMETER[\"Central_Meridian\",0.0],PARAMETER[\"Standard_Parallel_1\",0.0],\
        PARAMETER[\"Auxiliary_Sphere_Type\",0.0],UNIT[\"Meter\",1.0]]";
    assert!(same("EPSG:3857", web) && !same("EPSG:3395", web));
}
