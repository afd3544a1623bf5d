<?xml version="1.0" encoding="utf-8"?>
<!-- CityGML 2.0 as write/citygml/version2.py writes it, translated to CityGML 3.0. Surfaces are
     boundaries of a space and belong to constructions, heights say from where to where they were
     measured, generic attributes are elements of their own, footprint and roof edge are boundaries
     of level 0, and a solid has a shell. -->
<xsl:stylesheet version="1.0"
    xmlns:xsl="http://www.w3.org/1999/XSL/Transform"
    xmlns:oldbldg="http://www.opengis.net/citygml/building/2.0"
    xmlns:oldcore="http://www.opengis.net/citygml/2.0"
    xmlns:oldgen="http://www.opengis.net/citygml/generics/2.0"
    xmlns:oldgml="http://www.opengis.net/gml"
    xmlns:bldg="http://www.opengis.net/citygml/building/3.0"
    xmlns:con="http://www.opengis.net/citygml/construction/3.0"
    xmlns:core="http://www.opengis.net/citygml/3.0"
    xmlns:gen="http://www.opengis.net/citygml/generics/3.0"
    xmlns:gml="http://www.opengis.net/gml/3.2"
    xmlns:xlink="http://www.w3.org/1999/xlink"
    exclude-result-prefixes="oldbldg oldcore oldgen oldgml">

  <xsl:strip-space elements="*"/>
  <xsl:preserve-space elements="oldgml:name oldgen:value"/>

  <xsl:template match="/root">
    <root><xsl:apply-templates select="oldcore:cityObjectMember"/></root>
  </xsl:template>
  <xsl:template match="oldcore:cityObjectMember">
    <core:cityObjectMember><xsl:apply-templates select="*"/></core:cityObjectMember>
  </xsl:template>

  <!-- Buildings, parts, installations: what they have in the order of the schemas, which is core,
       construction, building. -->
  <xsl:template match="oldbldg:Building | oldbldg:BuildingPart | oldbldg:BuildingInstallation">
    <xsl:element name="bldg:{local-name()}">
      <xsl:apply-templates select="@oldgml:id"/>
      <xsl:apply-templates select="oldgml:name"/>
      <xsl:apply-templates select="oldcore:creationDate"/>
      <xsl:apply-templates select="oldcore:terminationDate"/>
      <xsl:apply-templates mode="date" select="oldgen:*[@name = 'hiproof_valid_from']"/>
      <xsl:apply-templates mode="date" select="oldgen:*[@name = 'hiproof_valid_to']"/>
      <xsl:apply-templates select="oldgen:*"/>
      <xsl:apply-templates
          select="oldbldg:boundedBy | oldbldg:lod0FootPrint | oldbldg:lod0RoofEdge"/>
      <xsl:apply-templates select="oldbldg:lod1Solid"/>
      <xsl:apply-templates select="oldbldg:lod2Solid | oldbldg:lod2Geometry"/>
      <xsl:apply-templates select="oldbldg:lod2MultiSurface"/>
      <xsl:apply-templates select="oldbldg:lod1TerrainIntersection"/>
      <xsl:apply-templates select="oldbldg:lod2TerrainIntersection"/>
      <xsl:apply-templates select="oldbldg:measuredHeight"/>
      <xsl:apply-templates select="oldbldg:function"/>
      <xsl:apply-templates select="oldbldg:roofType"/>
      <xsl:apply-templates select="oldbldg:outerBuildingInstallation"/>
      <xsl:apply-templates select="oldbldg:consistsOfBuildingPart"/>
    </xsl:element>
  </xsl:template>
  <xsl:template match="oldbldg:consistsOfBuildingPart">
    <bldg:buildingPart><xsl:apply-templates select="*"/></bldg:buildingPart>
  </xsl:template>
  <xsl:template match="oldbldg:outerBuildingInstallation">
    <bldg:buildingInstallation><xsl:apply-templates select="*"/></bldg:buildingInstallation>
  </xsl:template>

  <!-- Dates have a time. -->
  <xsl:template match="oldcore:creationDate | oldcore:terminationDate">
    <xsl:element name="core:{local-name()}"><xsl:value-of select="."/>T00:00:00</xsl:element>
  </xsl:template>
  <xsl:template mode="date" match="*[@name = 'hiproof_valid_from']">
    <core:validFrom><xsl:value-of select="*[1]"/>T00:00:00</core:validFrom>
  </xsl:template>
  <xsl:template mode="date" match="*[@name = 'hiproof_valid_to']">
    <core:validTo><xsl:value-of select="*[1]"/>T00:00:00</core:validTo>
  </xsl:template>

  <!-- Generic attributes, and named sets of them. -->
  <xsl:template match="oldgen:*">
    <core:genericAttribute><xsl:apply-templates mode="value" select="."/></core:genericAttribute>
  </xsl:template>
  <xsl:template mode="value" match="oldgen:intAttribute">
    <gen:IntAttribute><xsl:call-template name="pair"/></gen:IntAttribute>
  </xsl:template>
  <xsl:template mode="value" match="oldgen:doubleAttribute">
    <gen:DoubleAttribute><xsl:call-template name="pair"/></gen:DoubleAttribute>
  </xsl:template>
  <xsl:template mode="value" match="oldgen:stringAttribute">
    <gen:StringAttribute><xsl:call-template name="pair"/></gen:StringAttribute>
  </xsl:template>
  <xsl:template name="pair">
    <gen:name><xsl:value-of select="@name"/></gen:name>
    <gen:value><xsl:value-of select="*[1]"/></gen:value>
  </xsl:template>
  <xsl:template mode="value" match="oldgen:genericAttributeSet">
    <gen:GenericAttributeSet>
      <gen:name><xsl:value-of select="@name"/></gen:name>
      <xsl:for-each select="*">
        <gen:genericAttribute><xsl:apply-templates mode="value" select="."/></gen:genericAttribute>
      </xsl:for-each>
    </gen:GenericAttributeSet>
  </xsl:template>

  <!-- Surfaces. -->
  <xsl:template match="oldbldg:boundedBy">
    <core:boundary>
      <xsl:for-each select="*">
        <xsl:element name="con:{local-name()}">
          <xsl:apply-templates select="@oldgml:id"/>
          <xsl:apply-templates select="oldgml:name"/>
          <xsl:apply-templates select="oldcore:creationDate"/>
          <xsl:apply-templates select="oldgen:*"/>
          <xsl:apply-templates select="oldbldg:lod2MultiSurface"/>
        </xsl:element>
      </xsl:for-each>
    </core:boundary>
  </xsl:template>
  <xsl:template match="oldbldg:lod0FootPrint">
    <core:boundary>
      <con:GroundSurface><xsl:call-template name="level-0"/></con:GroundSurface>
    </core:boundary>
  </xsl:template>
  <xsl:template match="oldbldg:lod0RoofEdge">
    <core:boundary>
      <con:RoofSurface><xsl:call-template name="level-0"/></con:RoofSurface>
    </core:boundary>
  </xsl:template>
  <xsl:template name="level-0">
    <xsl:attribute name="gml:id">
      <xsl:value-of select="concat(local-name(), '-', ../@oldgml:id)"/>
    </xsl:attribute>
    <core:lod0MultiSurface><xsl:apply-templates select="*"/></core:lod0MultiSurface>
  </xsl:template>

  <xsl:template match="oldbldg:measuredHeight">
    <con:height>
      <con:Height>
        <con:highReference>highestRoofEdge</con:highReference>
        <con:lowReference>lowestGroundPoint</con:lowReference>
        <con:status>measured</con:status>
        <con:value uom="{@uom}"><xsl:value-of select="."/></con:value>
      </con:Height>
    </con:height>
  </xsl:template>

  <!-- Geometries, and what has the same name in both. -->
  <xsl:template match="oldbldg:lod2Geometry">
    <core:lod2Solid><xsl:apply-templates select="*"/></core:lod2Solid>
  </xsl:template>
  <xsl:template match="oldbldg:lod1TerrainIntersection | oldbldg:lod2TerrainIntersection">
    <xsl:element name="core:{local-name()}Curve"><xsl:apply-templates select="*"/></xsl:element>
  </xsl:template>
  <xsl:template match="oldbldg:lod1Solid | oldbldg:lod2Solid | oldbldg:lod2MultiSurface">
    <xsl:element name="core:{local-name()}"><xsl:apply-templates select="*"/></xsl:element>
  </xsl:template>
  <xsl:template match="oldgml:Solid/oldgml:exterior/oldgml:CompositeSurface">
    <gml:Shell><xsl:apply-templates select="@* | node()"/></gml:Shell>
  </xsl:template>
  <xsl:template match="oldgml:*">
    <xsl:element name="gml:{local-name()}"><xsl:apply-templates select="@* | node()"/></xsl:element>
  </xsl:template>
  <xsl:template match="oldbldg:*">
    <xsl:element name="bldg:{local-name()}">
      <xsl:apply-templates select="@* | node()"/>
    </xsl:element>
  </xsl:template>
  <xsl:template match="@*"><xsl:copy/></xsl:template>
  <xsl:template match="@oldgml:id">
    <xsl:attribute name="gml:id"><xsl:value-of select="."/></xsl:attribute>
  </xsl:template>
</xsl:stylesheet>
